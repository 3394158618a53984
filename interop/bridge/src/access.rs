//! Keys and access control: one command makes a network of which every member is known and may do what it may.

use crate::keys::{Name, ROOT};
use crate::link::MEMBER;
use crate::request::{ANYONE, Right};
use crate::stop_channel::new_key_line;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose, date_time_ymd,
};
use serde_json::{Value, json};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Who is to be a member.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Members {
    /// Names or addresses under which the bridge is reached.
    pub hosts: Vec<String>,
    /// Who may do what. Names of people or machines, each once.
    pub peers: Vec<(Name, Right)>,
    /// How long the keys are good for: who leaves without being told out is out by then.
    pub valid: Duration,
}

/// How long keys are good for unless told otherwise: a year.
pub const VALID: Duration = Duration::from_secs(365 * DAY_S);
const DAY_S: u64 = 86_400;
/// Under this key a configuration says until when its certificate is good, s since 1970.
pub const EXPIRES: &str = "expires_s";
/// Under this key a configuration names the file of its stop keys ([`crate::stop_channel`]).
pub const STOP_KEYS: &str = "stop_keys";

/// Why there are no keys.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AccessError {
    /// A file could not be made.
    #[error("{}: {cause}; keys are written once, into a folder you may write to", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        cause: io::Error,
    },
    /// Two members of one name, or one of a name that is taken.
    #[error("`{0}` is there twice: a peer has one right, and `bridge`, `authority` and `anyone` are taken")]
    Twice(Name),
    /// A certificate could not be made.
    #[error("no certificate: {0}")]
    Certificate(#[from] rcgen::Error),
}

/// The bridge's own name among the files.
const BRIDGE: &str = "bridge";
/// The name of who guarantees for all.
const AUTHORITY: &str = "authority";

/// Writes certificates, keys and one Zenoh configuration for the bridge and each member; the configurations written.
///
/// # Errors
/// [`AccessError`]; no file is ever replaced.
pub fn write_keys(folder: &Path, members: &Members) -> Result<Vec<PathBuf>, AccessError> {
    for (at, (name, _)) in members.peers.iter().enumerate() {
        let before = members.peers.iter().take(at).any(|(other, _)| other == name);
        if before || [BRIDGE, AUTHORITY, ANYONE].contains(&name.to_string().as_str()) {
            return Err(AccessError::Twice(name.clone()));
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

/// Who guarantees for all members, and the certificate by which they know it. Its key is thrown away: a new member means new keys
/// for all, and nobody can ever add one secretly.
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

/// Returns the first file with a private key that others than its owner may read or write: one that the TLS part of a Zenoh
/// configuration names, the stop keys, or the configuration itself if it holds a key.
pub(crate) fn exposed_key(tls: &Value, metadata: &Value, config: Option<&Path>) -> Option<PathBuf> {
    let text = |key: &str| tls.get(key).and_then(Value::as_str);
    let ends = ["listen", "connect"];
    let named = ends.iter().filter_map(|end| text(&format!("{end}_private_key")));
    let named = named.chain(metadata.get(STOP_KEYS).and_then(Value::as_str)).map(PathBuf::from);
    let inline = ends.iter().filter_map(|end| text(&format!("{end}_private_key_base64")));
    let holding = inline.filter_map(|_| config.map(Path::to_path_buf));
    // Zenoh reports a file that is missing.
    let is_exposed =
        |file: &PathBuf| file.metadata().is_ok_and(|found| found.permissions().mode() & 0o077 != 0);
    named.chain(holding).find(is_exposed)
}

/// Good from yesterday, for clocks that differ, to as long from now as chosen.
fn expire(parameters: &mut CertificateParams, valid: Duration) {
    let at = |s: u64| date_time_ymd(1970, 1, 1) + Duration::from_secs(s);
    parameters.not_before = at(now_s().saturating_sub(DAY_S));
    // Certificates know no year 10000.
    parameters.not_after = at(now_s().saturating_add(valid.as_secs()).min(8000 * 365 * DAY_S));
}

pub(crate) fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs())
}

/// What a Zenoh configuration says of keys: both ends show theirs.
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

/// What this program reads in a configuration: name, end of the validity, and stop keys.
fn metadata(folder: &Path, name: &str, members: &Members) -> Value {
    let expires_s = now_s().saturating_add(members.valid.as_secs());
    if members.peers.is_empty() {
        return json!({ MEMBER: name, EXPIRES: expires_s });
    }
    json!({ MEMBER: name, EXPIRES: expires_s, STOP_KEYS: folder.join(format!("{name}.stop")) })
}

/// The access control of a bridge without keys: it cannot tell anybody apart, but nobody tells anything in its name.
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

/// What everybody may do that gets in: the bridge tells, they listen; who may couple puts what its hand does.
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

/// What a member may ask for, under its own name only: a rule for each right up to its own.
fn asking(name: &Name, right: Right) -> Vec<Value> {
    let rights = Right::ALL.into_iter().filter(|other| *other <= right);
    let asks = rights.map(|right| {
        let keys = right.keys().iter().map(|key| format!("{ROOT}/*/{key}/{name}")).collect();
        rule(&format!("{}-{name}", word(right)), "ingress", json!(["query"]), keys)
    });
    asks.collect()
}

/// Nobody may do anything, but: the bridge tells everybody, members may listen and ask by their rights.
fn access_control(members: &Members) -> Value {
    let mut rules = rules();
    let mut policies = Vec::new();
    for (name, right) in &members.peers {
        let asking = asking(name, *right);
        let mut allowed = vec![json!("tell"), json!("listen")];
        allowed.extend(asking.iter().map(|rule| rule["id"].clone()));
        // Who holds the other end of a coupling moves the hand here.
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

const fn word(right: Right) -> &'static str {
    match right {
        Right::Watch => "watch",
        Right::Operate => "operate",
        Right::Own => "own",
    }
}

/// Who may read a file.
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
