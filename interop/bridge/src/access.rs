//! Keys and access control of a network: certificate, private key, stop key and Zenoh configuration of each member, and the
//! rights of each.

use crate::keys::{Name, ROOT};
use crate::request::{ANYONE, Right};
use crate::stop_channel::new_key_line;
use crate::wall_clock::since_1970;
use clap::ValueEnum;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose, date_time_ymd,
};
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Hosts of the bridge and members of a network, with the validity of their keys.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Members {
    /// Names or addresses of the bridge's host, for its certificate and for the members' endpoints.
    pub hosts: Vec<String>,
    /// Names of people or machines with their rights; each name once.
    pub peers: Vec<(Name, Right)>,
    /// Validity of the keys from now on. A single key cannot be revoked: a former member keeps access until the keys expire, or
    /// until all keys are replaced.
    pub valid: Duration,
}

/// Default validity of the keys: 365 days.
pub const VALID: Duration = Duration::from_secs(365 * DAY_S);
const DAY_S: u64 = 86_400;
/// Key of the member's name in the `metadata` of a configuration.
pub const MEMBER: &str = "member";
/// Key of the certificate's expiry, s since 1970, in the `metadata` of a configuration.
pub const EXPIRES: &str = "expires_s";
/// Key of the path of the stop keys ([`crate::stop_channel`]) in the `metadata` of a configuration.
pub const STOP_KEYS: &str = "stop_keys";

/// Error of writing keys.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// A file could not be created.
    #[error("cannot create {}: {cause}; choose a new folder in a place where you may write: the command overwrites no keys", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: io::Error,
    },
    /// A member's name appears twice.
    #[error(
        "the name `{0}` is given twice; give each member one name and one right, which includes the lower rights"
    )]
    Twice(Name),
    /// A member's name is reserved.
    #[error(
        "the name `{0}` is reserved, as are `{BRIDGE}`, `{AUTHORITY}` and `{ANYONE}`; give the member another name"
    )]
    Reserved(Name),
    /// A certificate could not be created.
    #[error("cannot create a certificate: {0}; check the values of --host")]
    Certificate(#[from] rcgen::Error),
}

/// File name of the bridge, reserved among the members.
const BRIDGE: &str = "bridge";
/// File name of the certificate authority, reserved among the members.
const AUTHORITY: &str = "authority";

/// Writes certificate, private key and Zenoh configuration of the bridge and of each member, and the stop keys, to `folder`,
/// which is created if absent. Returns the paths of the configurations, the bridge's first.
///
/// # Errors
/// [`AccessError`]. Existing files are never replaced; files that were written before the error remain.
pub fn write_keys(folder: &Path, members: &Members) -> Result<Vec<PathBuf>, AccessError> {
    for (at, (name, _)) in members.peers.iter().enumerate() {
        let before = members.peers.iter().take(at).any(|(other, _)| other == name);
        if before {
            return Err(AccessError::Twice(name.clone()));
        }
        if [BRIDGE, AUTHORITY, ANYONE].contains(&name.to_string().as_str()) {
            return Err(AccessError::Reserved(name.clone()));
        }
    }
    std::fs::create_dir_all(folder).map_err(|cause| AccessError::File { path: folder.into(), cause })?;
    let folder = folder.canonicalize().map_err(|cause| AccessError::File { path: folder.into(), cause })?;
    let authority = authority(members.valid)?;
    write(&folder.join(format!("{AUTHORITY}.pem")), &authority.1, Readers::All)?;
    let certify = |name: &str, hosts: &[String]| -> Result<(), AccessError> {
        let key = KeyPair::generate()?;
        let certificate = member(name, hosts, members.valid)?.signed_by(&key, &authority.0)?;
        write(&folder.join(format!("{name}.pem")), &certificate.pem(), Readers::All)?;
        write(&folder.join(format!("{name}.key")), &key.serialize_pem(), Readers::Owner)
    };
    certify(BRIDGE, &members.hosts)?;
    write_stop_keys(&folder, members)?;
    let mut written = vec![folder.join(format!("{BRIDGE}.json5"))];
    write_config(&written[0], &bridge_config(&folder, members))?;
    for (name, _) in &members.peers {
        let name = name.to_string();
        certify(&name, std::slice::from_ref(&name))?;
        let file = folder.join(format!("{name}.json5"));
        write_config(&file, &peer_config(&folder, &name, members))?;
        written.push(file);
    }
    Ok(written)
}

/// Writes a stop key for each member, once for the member and once for the bridge.
fn write_stop_keys(folder: &Path, members: &Members) -> Result<(), AccessError> {
    let mut all = String::new();
    for (name, _) in &members.peers {
        let path = folder.join(format!("{name}.stop"));
        let line = new_key_line(&name.to_string())
            .map_err(|cause| AccessError::File { path: path.clone(), cause })?;
        write(&path, &line, Readers::Owner)?;
        all.push_str(&line);
    }
    if all.is_empty() { Ok(()) } else { write(&folder.join(format!("{BRIDGE}.stop")), &all, Readers::Owner) }
}

/// Creates the certificate authority of all members, and its certificate as PEM. The authority's key is discarded: a new member
/// requires new keys for all, and nobody can ever add a member secretly.
fn authority(valid: Duration) -> Result<(Issuer<'static, KeyPair>, String), AccessError> {
    let mut parameters = CertificateParams::default();
    expire(&mut parameters, valid);
    parameters.distinguished_name.push(DnType::CommonName, format!("{ROOT} {AUTHORITY}"));
    parameters.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    parameters.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::DigitalSignature];
    let key = KeyPair::generate()?;
    let certificate = parameters.self_signed(&key)?.pem();
    Ok((Issuer::new(parameters, key), certificate))
}

fn member(name: &str, hosts: &[String], valid: Duration) -> Result<CertificateParams, AccessError> {
    let mut parameters = CertificateParams::new(hosts)?;
    expire(&mut parameters, valid);
    parameters.distinguished_name.push(DnType::CommonName, name);
    parameters.extended_key_usages =
        vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
    parameters.key_usages = vec![KeyUsagePurpose::DigitalSignature];
    Ok(parameters)
}

/// Returns the first file with a private key that users other than its owner can access (any of the mode bits 077): a key file
/// of the TLS section, the stop keys, or the configuration itself if it contains a key.
pub(crate) fn exposed_key(tls: &Value, metadata: &Value, config: Option<&Path>) -> Option<PathBuf> {
    let text = |key: &str| tls.get(key).and_then(Value::as_str);
    let ends = ["listen", "connect"];
    let named = ends.iter().filter_map(|end| text(&format!("{end}_private_key")));
    let named = named.chain(metadata.get(STOP_KEYS).and_then(Value::as_str)).map(PathBuf::from);
    let inline = ends.iter().filter_map(|end| text(&format!("{end}_private_key_base64")));
    let holding = inline.filter_map(|_| config.map(Path::to_path_buf));
    // Zenoh reports a missing file.
    let is_exposed =
        |file: &PathBuf| file.metadata().is_ok_and(|found| found.permissions().mode() & 0o077 != 0);
    named.chain(holding).find(is_exposed)
}

/// Sets the validity period: from one day ago, to tolerate clocks that differ, until `valid` from now.
fn expire(parameters: &mut CertificateParams, valid: Duration) {
    let at = |s: u64| date_time_ymd(1970, 1, 1) + Duration::from_secs(s);
    parameters.not_before = at(since_1970().as_secs().saturating_sub(DAY_S));
    // The year of a certificate's date has four digits.
    parameters.not_after = at(since_1970().as_secs().saturating_add(valid.as_secs()).min(8000 * 365 * DAY_S));
}

/// Returns the TLS section of a Zenoh configuration, with certificates of both ends (mutual TLS).
fn tls(folder: &Path, name: &str) -> Value {
    let file = |name: &str, kind: &str| folder.join(format!("{name}.{kind}")).display().to_string();
    json!({
        "enable_mtls": true,
        "root_ca_certificate": file(AUTHORITY, "pem"),
        "listen_certificate": file(name, "pem"),
        "listen_private_key": file(name, "key"),
        "connect_certificate": file(name, "pem"),
        "connect_private_key": file(name, "key"),
        "verify_name_on_connect": true,
    })
}

fn bridge_config(folder: &Path, members: &Members) -> Value {
    json!({
        "mode": "peer",
        "metadata": metadata(folder, BRIDGE, members),
        "listen": { "endpoints": ["tls/0.0.0.0:7447"] },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": { "link": { "protocols": ["tls"], "tls": tls(folder, BRIDGE) } },
        "access_control": access_control(members),
    })
}

fn peer_config(folder: &Path, name: &str, members: &Members) -> Value {
    let endpoints: Vec<String> = members.hosts.iter().map(|host| format!("tls/{host}:7447")).collect();
    json!({
        "mode": "client",
        "metadata": metadata(folder, name, members),
        "connect": { "endpoints": endpoints },
        "scouting": { "multicast": { "enabled": false }, "gossip": { "enabled": false } },
        "transport": { "link": { "protocols": ["tls"], "tls": tls(folder, name) } },
    })
}

/// Returns the metadata that this program reads in a configuration: name, expiry, and, with members, the path of the stop keys.
fn metadata(folder: &Path, name: &str, members: &Members) -> Value {
    let expires_s = since_1970().as_secs().saturating_add(members.valid.as_secs());
    if members.peers.is_empty() {
        return json!({ MEMBER: name, EXPIRES: expires_s });
    }
    json!({ MEMBER: name, EXPIRES: expires_s, STOP_KEYS: folder.join(format!("{name}.stop")) })
}

/// Returns the access control section for a bridge without keys: peers are not distinguished and may send any request, but no
/// peer can publish the bridge's messages.
pub(crate) fn of_anyone() -> Vec<(&'static str, Value)> {
    let rules: Vec<Value> = rules().into_iter().chain(asking(&Name::anyone(), Right::Own)).collect();
    let allowed: Vec<Value> = rules.iter().map(|rule| rule["id"].clone()).collect();
    vec![
        ("default_permission", json!("deny")),
        ("rules", json!(rules)),
        ("subjects", json!([{ "id": ANYONE }])),
        ("policies", json!([{ "rules": allowed, "subjects": [ANYONE] }])),
        ("enabled", json!(true)),
    ]
}

fn rule(id: &str, flow: &str, messages: Value, keys: Vec<String>) -> Value {
    json!({ "id": id, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys })
}

/// Returns the common rules: with `tell` and `listen` a peer receives the bridge's messages, with `couple` it publishes the peer
/// state of a coupling.
fn rules() -> Vec<Value> {
    let of_any = |keys: &[&str]| keys.iter().map(|key| format!("{ROOT}/*/{key}")).collect::<Vec<_>>();
    vec![
        rule(
            "tell",
            "egress",
            json!(["put", "reply", "declare_queryable", "declare_subscriber", "liveliness_token"]),
            vec![format!("{ROOT}/**")],
        ),
        rule(
            "listen",
            "ingress",
            json!(["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query", "query"]),
            of_any(&["*", "news/*"]),
        ),
        rule("couple", "ingress", json!(["put"]), of_any(&["couple/*"])),
    ]
}

/// Returns the rules that permit a member's requests, on keys with the member's own name only: one rule per right up to `right`.
fn asking(name: &Name, right: Right) -> Vec<Value> {
    let rights = Right::ALL.into_iter().filter(|other| *other <= right);
    let asks = rights.map(|right| {
        let keys = right.keys().iter().map(|key| format!("{ROOT}/*/{key}/{name}")).collect();
        rule(&format!("{}-{name}", word(right)), "ingress", json!(["query"]), keys)
    });
    asks.collect()
}

/// Returns the access control section for a bridge with members: deny by default; every member receives the bridge's messages,
/// and sends the requests that its right permits.
fn access_control(members: &Members) -> Value {
    let mut rules = rules();
    let mut policies = Vec::new();
    for (name, right) in &members.peers {
        let asking = asking(name, *right);
        let mut allowed = vec![json!("tell"), json!("listen")];
        allowed.extend(asking.iter().map(|rule| rule["id"].clone()));
        // The other end of a coupling exerts force on the hand here, so it needs the right to operate.
        allowed.extend((*right >= Right::Operate).then_some(json!("couple")));
        policies.push(json!({ "rules": allowed, "subjects": [name.to_string()] }));
        rules.extend(asking);
    }
    let subjects: Vec<Value> = members
        .peers
        .iter()
        .map(|(name, _)| json!({ "id": name.to_string(), "cert_common_names": [name.to_string()] }))
        .collect();
    json!({ "enabled": true, "default_permission": "deny", "rules": rules, "subjects": subjects, "policies": policies })
}

/// Returns the name of a right on the command line.
pub(crate) fn word(right: Right) -> String {
    right.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

/// Read permission of a file.
#[derive(Clone, Copy)]
enum Readers {
    All,
    Owner,
}

fn write_config(path: &Path, config: &Value) -> Result<(), AccessError> {
    write(path, &format!("{config:#}\n"), Readers::All)
}

fn write(path: &Path, text: &str, readers: Readers) -> Result<(), AccessError> {
    let mode = match readers {
        Readers::All => 0o644,
        Readers::Owner => 0o600,
    };
    let file = OpenOptions::new().write(true).create_new(true).mode(mode).open(path);
    file.and_then(|mut file| file.write_all(text.as_bytes()))
        .map_err(|cause| AccessError::File { path: path.into(), cause })
}
