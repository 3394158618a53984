//! Zenoh session of this program: default endpoints, checks of the keys, and the stop channel that belongs to it.

use crate::access;
use crate::keys::Name;
use crate::stop_channel::{StopChannel, StopKeys};
use crate::wall_clock::since_1970;
use clap::Args;
use flotor_hal::read_text;
use flotor_live::Directory;
use serde_json::{Value, json};
use std::net::IpAddr;
use std::ops::Deref;
use std::path::PathBuf;
use zenoh::config::EndPoint;
use zenoh::{Config, Session, Wait};

/// Prefix of Zenoh endpoints on Unix sockets.
const UNIX: &str = "unixsock-stream/";
/// Prefix of the file names of bridge sockets: `bridge-NAME`.
const SOCKET: &str = "bridge-";

/// Command line options of a session.
#[derive(Args, Clone, Debug, Default)]
pub struct LinkOptions {
    /// Zenoh configuration (JSON5): endpoints, keys, access control; `flotor bridge keys` writes configurations
    #[arg(long, value_name = "FILE", global = true)]
    pub config: Option<PathBuf>,
    /// Endpoint to listen on in place of those in --config, such as tls/0.0.0.0:7447 (repeatable)
    #[arg(long, value_name = "ENDPOINT", global = true)]
    pub listen: Vec<String>,
    /// Endpoint to connect to in place of those in --config, such as tls/lab.example.org:7447 (repeatable)
    #[arg(long, value_name = "ENDPOINT", global = true)]
    pub connect: Vec<String>,
    /// Listen or connect beyond this machine without keys: every reachable peer has the rights of --allow
    #[arg(long, global = true)]
    pub without_keys: bool,
}

/// Error of opening or using a session.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// The configuration, or a file that it names, cannot be read or is invalid.
    #[error(
        "cannot use the configuration {}: {reason}; correct the path or the file, or create new keys and \
         configurations with `flotor bridge keys`", file.display())]
    Config {
        /// Path of the configuration.
        file: PathBuf,
        /// Cause.
        reason: String,
    },
    /// A text of `--listen` or `--connect` is not an endpoint.
    #[error("`{option} {endpoint}` is not PROTOCOL/ADDRESS; write, for example, tls/lab.example.org:7447")]
    Endpoint {
        /// Command line option.
        option: &'static str,
        /// Given text.
        endpoint: String,
    },
    /// Other users can access a secret key: whoever has the key can act as the member until the certificate expires.
    #[error(
        "other users can access the secret key in {}; run `chmod 600 {}`, and create new keys with `flotor \
         bridge keys` if another user may have read or changed the file", file.display(), file.display())]
    ExposedKey {
        /// Path of the file with the key.
        file: PathBuf,
    },
    /// An endpoint is open to other users, and without keys they would have all rights of `--allow`.
    #[error(
        "`{endpoint}` is open to other users, and only keys distinguish members: give a configuration of `flotor \
         bridge keys` with --config (a bridge: bridge.json5), or accept every peer with --without-keys"
    )]
    WithoutKeys {
        /// Offending endpoint.
        endpoint: String,
    },
    /// The session cannot be opened.
    #[error("cannot open the session: {0}; check the keys, and that the endpoint is free or its bridge runs")]
    Open(String),
    /// A network operation has failed.
    #[error("network error: {0}; check the connection and the peer")]
    Network(String),
}

impl From<zenoh::Error> for LinkError {
    fn from(error: zenoh::Error) -> Self {
        Self::Network(words(&error))
    }
}

/// Returns the message of an error without the places in Zenoh's source (` at FILE.rs:LINE.`).
fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    let (mut words, mut rest) = (String::new(), text.as_str());
    while let Some((before, after)) = rest.split_once(".rs:") {
        words += before.rsplit_once(" at ").map_or(before, |(message, _)| message);
        rest = after.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    }
    words + rest
}

/// Synchronous completion of a Zenoh operation, with its error as [`LinkError`].
pub(crate) trait WaitNow<T> {
    /// Waits for the operation. A declaration is local and completes at once.
    fn wait_now(self) -> Result<T, LinkError>;
}

impl<T, R> WaitNow<T> for R
where
    R: Wait + zenoh::Resolvable<To = zenoh::Result<T>>,
{
    fn wait_now(self) -> Result<T, LinkError> {
        self.wait().map_err(LinkError::from)
    }
}

/// Role of this program on a link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Accepts connections of peers.
    Serving,
    /// Connects to peers.
    Visiting,
}

/// Open session, with member name, expiry of the keys, and stop channel of this program.
#[derive(Clone)]
pub struct Link {
    session: Session,
    member: Name,
    expires_s: Option<u64>,
    stop_channel: Option<StopChannel>,
    lacks_stop_keys: bool,
}

impl Link {
    /// Returns true if the keys lack stop keys, which older versions did not write: a member's emergency stop then relies on a
    /// session alone, which a flood of connections can delay.
    #[must_use]
    pub fn lacks_stop_keys(&self) -> bool {
        self.lacks_stop_keys
    }

    /// Returns the stop channel, the second path of an emergency stop; `None` without a TCP or TLS endpoint with a fixed port, and
    /// for a bridge with access control but without stop keys.
    #[must_use]
    pub fn stop_channel(&self) -> Option<&StopChannel> {
        self.stop_channel.as_ref()
    }

    /// Returns the member name of this program in its configuration; without keys, `anyone`.
    pub fn member(&self) -> &Name {
        &self.member
    }

    /// Returns the remaining validity of the keys in whole days, rounded down: 0 on the last day and after the expiry; `None`
    /// without an expiry in the configuration.
    #[must_use]
    pub fn days_left(&self) -> Option<u64> {
        Some(self.expires_s?.saturating_sub(since_1970().as_secs()) / 86_400)
    }
}

impl Deref for Link {
    type Target = Session;

    fn deref(&self) -> &Session {
        &self.session
    }
}

impl LinkOptions {
    /// Fills in default endpoints if neither a configuration nor an endpoint is given: sockets in the folder of this user's runs,
    /// which no other user can enter. A bridge (`serves`) listens on its own socket; a visitor connects to all sockets found.
    #[must_use]
    pub fn or_this_user(mut self, directory: &Directory, serves: Option<&Name>) -> Self {
        if self.config.is_some() || !self.listen.is_empty() || !self.connect.is_empty() {
            return self;
        }
        let endpoint = |file: &str| format!("{UNIX}{}", directory.path().join(file).display());
        match serves {
            Some(name) => self.listen.push(endpoint(&format!("{SOCKET}{name}"))),
            None => {
                let files = directory.files().into_iter();
                let files = files.filter_map(|entry| entry.file_name().into_string().ok());
                let sockets = files
                    .filter(|file| file.strip_prefix(SOCKET).is_some_and(|name| Name::new(name).is_ok()));
                self.connect.extend(sockets.map(|file| endpoint(&file)));
            }
        }
        self
    }

    /// Returns the first endpoint that other users, of this machine at least, can reach; `None` if all are Unix sockets.
    #[must_use]
    pub fn open_to_others(&self) -> Option<&str> {
        self.listen
            .iter()
            .chain(&self.connect)
            .map(String::as_str)
            .find(|endpoint| !endpoint.starts_with(UNIX))
    }
}

/// Returns true if an endpoint can be reached from this machine only.
fn is_loopback(endpoint: &str) -> bool {
    let address = endpoint.split_once('/').map_or("", |(_, address)| address);
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host).trim_matches(['[', ']']);
    endpoint.starts_with(UNIX)
        || host == "localhost"
        || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Opens a session. Without a configuration file, peers are found by the given endpoints only, not by multicast. Not real-time.
///
/// # Errors
/// [`LinkError`] of the configuration, the keys or the session.
pub fn open(options: &LinkOptions, end: End) -> Result<Link, LinkError> {
    let mut config = config_of(options)?;
    if let Some(file) = exposed_key(options, &config) {
        return Err(LinkError::ExposedKey { file });
    }
    let has_rules = has_rules(&config);
    // A visitor's configuration is the user's own; its access rules are not known here.
    let is_known = end == End::Serving || options.config.is_none();
    if is_known && !(options.config.is_some() && has_rules) && !options.without_keys {
        let places = ["listen/endpoints", "connect/endpoints"];
        // A visitor connects to the given endpoints, and accepts no connections.
        let places = places.get(..if end == End::Serving { 2 } else { 1 }).unwrap_or_default();
        let endpoints = places.iter().flat_map(|key| endpoints_in(&says(&config, key).unwrap_or_default()));
        if let Some(endpoint) = endpoints.into_iter().find(|endpoint| !is_loopback(endpoint)) {
            return Err(LinkError::WithoutKeys { endpoint });
        }
    }
    let stop_channel = stop_channel_of(options, &config, end)?;
    if end == End::Serving && !has_rules {
        // Any peer may connect, but only the bridge may publish.
        for (key, value) in access::of_anyone() {
            config.insert_json5(&format!("access_control/{key}"), &value.to_string())?;
        }
    }
    let metadata = says(&config, "metadata").unwrap_or_default();
    let has_members = end == End::Visiting || says(&config, "access_control/policies") != Some(json!([]));
    let lacks_stop_keys =
        has_members && metadata.get(access::EXPIRES).is_some() && metadata.get(access::STOP_KEYS).is_none();
    let session = zenoh::open(config).wait().map_err(|error| LinkError::Open(words(&error)))?;
    let (member, expires_s) = (member_of(&metadata), metadata.get(access::EXPIRES).and_then(Value::as_u64));
    Ok(Link { session, member, expires_s, stop_channel, lacks_stop_keys })
}

/// Returns a visitor's stop channel without opening a session, which may block; `None` without a TCP or TLS endpoint with a fixed
/// port.
///
/// # Errors
/// [`LinkError`] of the configuration or its stop keys.
pub fn stop_channel(options: &LinkOptions) -> Result<Option<StopChannel>, LinkError> {
    stop_channel_of(options, &config_of(options)?, End::Visiting)
}

/// Returns the stop channel of one end; `None` without a TCP or TLS endpoint with a fixed port, or for a bridge with access control
/// but without stop keys. In all other cases without stop keys, the HMAC key is the well-known (empty) one of the member `anyone`.
fn stop_channel_of(
    options: &LinkOptions,
    config: &Config,
    end: End,
) -> Result<Option<StopChannel>, LinkError> {
    let metadata = says(config, "metadata").unwrap_or_default();
    let keys = match metadata.get(access::STOP_KEYS).and_then(Value::as_str) {
        Some(file) => StopKeys::read(file.as_ref()).map_err(|error| LinkError::Config {
            file: options.config.clone().unwrap_or_default(),
            reason: format!("{file}: {error}"),
        })?,
        None if end == End::Serving && has_rules(config) => return Ok(None),
        None => StopKeys::of_anyone(),
    };
    let endpoints = match end {
        End::Serving => "listen/endpoints",
        End::Visiting => "connect/endpoints",
    };
    let endpoints = endpoints_in(&says(config, endpoints).unwrap_or_default());
    let addresses: Vec<String> = endpoints.iter().filter_map(|endpoint| datagram_address(endpoint)).collect();
    let expires_s = metadata.get(access::EXPIRES).and_then(Value::as_u64);
    Ok((!addresses.is_empty()).then(|| StopChannel {
        addresses,
        member: member_of(&metadata),
        keys,
        expires_s,
    }))
}

/// Returns the `host:port` of an internet endpoint, for datagrams; `None` where the system chooses the port.
fn datagram_address(endpoint: &str) -> Option<String> {
    let (protocol, address) = endpoint.split_once('/')?;
    let address = address.split(['?', '#']).next()?;
    (matches!(protocol, "tcp" | "tls") && !address.ends_with(":0")).then(|| address.to_owned())
}

/// Returns the member name in the metadata of a configuration; without keys, `anyone`.
fn member_of(metadata: &Value) -> Name {
    let member = metadata.get(access::MEMBER).and_then(Value::as_str).and_then(|name| Name::new(name).ok());
    member.unwrap_or_else(Name::anyone)
}

fn config_of(options: &LinkOptions) -> Result<Config, LinkError> {
    let mut config = Config::default();
    if let Some(path) = &options.config {
        let text = read_text(path, "the file").map_err(|wrong| zenoh::Error::from(wrong.problem));
        config = text
            .and_then(|text| Config::from_json5(&text))
            .map_err(|error| LinkError::Config { file: path.clone(), reason: words(&error) })?;
    } else {
        config.insert_json5("mode", "\"peer\"")?;
        config.insert_json5("scouting/multicast/enabled", "false")?;
        config.insert_json5("scouting/gossip/enabled", "false")?;
    }
    for (option, key, given) in [
        ("--listen", "listen/endpoints", &options.listen),
        ("--connect", "connect/endpoints", &options.connect),
    ] {
        if let Some(endpoint) = given.iter().find(|text| text.parse::<EndPoint>().is_err()) {
            return Err(LinkError::Endpoint { option, endpoint: endpoint.clone() });
        }
        // Without a configuration and an endpoint, Zenoh lets a visitor listen on all interfaces.
        if options.config.is_none() || !given.is_empty() {
            config.insert_json5(key, &list(given))?;
        }
    }
    Ok(config)
}

fn says(config: &Config, key: &str) -> Option<Value> {
    serde_json::from_str(&config.get_json(key).ok()?).ok()
}

fn has_rules(config: &Config) -> bool {
    says(config, "access_control/enabled") == Some(Value::Bool(true))
}

fn exposed_key(options: &LinkOptions, config: &Config) -> Option<PathBuf> {
    let part = |key: &str| says(config, key).unwrap_or_default();
    access::exposed_key(&part("transport/link/tls"), &part("metadata"), options.config.as_deref())
}

/// Collects the endpoints in a value of a configuration: one endpoint, a list, or a list per mode.
fn endpoints_in(value: &Value) -> Vec<String> {
    match value {
        Value::String(endpoint) => vec![endpoint.clone()],
        Value::Array(values) => values.iter().flat_map(endpoints_in).collect(),
        Value::Object(values) => values.values().flat_map(endpoints_in).collect(),
        _ => Vec::new(),
    }
}

fn list(endpoints: &[String]) -> String {
    serde_json::to_string(endpoints).unwrap_or_else(|_| "[]".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_be_reached_from_elsewhere_is_known() {
        for here in ["tcp/127.0.0.1:7447", "tcp/localhost:1", "tcp/[::1]:7447", "unixsock-stream//tmp/x"] {
            assert!(is_loopback(here), "{here}");
        }
        for elsewhere in
            ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tls/lab.example.org:7447", "tcp/10.0.0.1:1", ""]
        {
            assert!(!is_loopback(elsewhere), "{elsewhere}");
        }
    }

    #[test]
    fn beyond_this_machine_without_keys_is_refused_unless_said_twice() {
        let listen = vec!["tcp/0.0.0.0:0".to_owned()];
        let options = LinkOptions { listen, ..LinkOptions::default() };
        // A visitor that listens would be told anything by anybody.
        for end in [End::Serving, End::Visiting] {
            assert!(matches!(open(&options, end), Err(LinkError::WithoutKeys { .. })), "{end:?}");
        }
        assert!(open(&LinkOptions { without_keys: true, ..options }, End::Serving).is_ok());
        // Whoever is at the other end has the rights, too.
        let connect = vec!["tcp/192.0.2.1:7447".to_owned()];
        let options = LinkOptions { connect, ..LinkOptions::default() };
        assert!(matches!(open(&options, End::Serving), Err(LinkError::WithoutKeys { .. })));
    }

    #[test]
    fn a_configuration_without_an_end_is_not_read() {
        let options = LinkOptions { config: Some("/dev/zero".into()), ..LinkOptions::default() };
        let refused = open(&options, End::Serving).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.contains("/dev/zero") && refused.contains("a pipe or a device"), "{refused}");
    }

    #[test]
    fn a_key_that_others_may_read_is_refused_with_the_remedy() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let hosts = vec!["localhost".to_owned()];
        let members = access::Members { hosts, peers: Vec::new(), valid: access::VALID };
        let config = access::write_keys(folder.path(), &members).unwrap().remove(0);
        let listen = vec!["tls/127.0.0.1:0".to_owned()];
        let options = LinkOptions { config: Some(config), listen, ..LinkOptions::default() };
        assert!(open(&options, End::Serving).is_ok());
        let key = folder.path().join("bridge.key");
        for mode in [0o644, 0o640, 0o602] {
            std::fs::set_permissions(&key, std::fs::Permissions::from_mode(mode)).unwrap();
            let refused =
                open(&options, End::Serving).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(refused.contains("chmod 600") && refused.contains("bridge.key"), "{mode:o}: {refused}");
        }
    }

    #[test]
    fn where_nothing_is_said_only_this_user_gets_in() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path());
        let name = Name::new("lab").unwrap();
        let serving = LinkOptions::default().or_this_user(&directory, Some(&name));
        assert_eq!(serving.listen, [format!("unixsock-stream/{}/bridge-lab", scratch.path().display())]);
        assert_eq!(serving.open_to_others(), None);
        std::fs::write(scratch.path().join("bridge-lab"), "").unwrap();
        std::fs::write(scratch.path().join("bridge-lab.lock"), "").unwrap();
        let visiting = LinkOptions::default().or_this_user(&directory, None);
        assert_eq!(visiting.connect, serving.listen);
        let said = LinkOptions { connect: vec!["tcp/127.0.0.1:1".to_owned()], ..LinkOptions::default() };
        assert_eq!(said.clone().or_this_user(&directory, None).connect, said.connect);
    }
}
