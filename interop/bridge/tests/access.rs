//! Who is no member gets nothing; who is one may do what the keys say, and no more.

mod common;

use common::{Bridge, FakeHost, free_port, wait_until};
use flotor_bridge::access::{AccessError, Members, VALID, write_keys};
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::remote::Remote;
use flotor_bridge::request::{NumberedRequest, Request, Right};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;
use zenoh::Wait;

static NEVER: AtomicBool = AtomicBool::new(false);

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn members() -> Members {
    let peers =
        vec![(name("alan"), Right::Watch), (name("grace"), Right::Operate), (name("ada"), Right::Own)];
    Members { hosts: vec!["localhost".to_owned(), "127.0.0.1".to_owned()], peers, valid: VALID }
}

/// A bridge of members, and the folder with their keys.
fn closed(host: &FakeHost) -> (tempfile::TempDir, Bridge) {
    let folder = tempfile::tempdir().unwrap();
    write_keys(folder.path(), &members()).unwrap();
    let link = LinkOptions { config: Some(folder.path().join("bridge.json5")), ..LinkOptions::default() };
    let bridge =
        Bridge::start_with(&host.directory, Right::Own, format!("tls/localhost:{}", free_port()), link);
    (folder, bridge)
}

/// The link of a member to a bridge, as the member's own configuration makes it.
fn link_of(folder: &Path, who: &str, bridge: &Bridge) -> LinkOptions {
    LinkOptions {
        config: Some(folder.join(format!("{who}.json5"))),
        connect: vec![bridge.endpoint.clone()],
        ..LinkOptions::default()
    }
}

/// A member at a bridge.
fn visit(folder: &Path, who: &str, bridge: &Bridge) -> Remote {
    Remote::listen(&open(&link_of(folder, who, bridge), End::Visiting).unwrap(), &bridge.name).unwrap()
}

#[test]
fn rights_are_what_the_keys_say() {
    let host = FakeHost::start();
    let (folder, bridge) = closed(&host);

    let weight = || Request::Weight { model: "spring".to_owned(), weight: 0.5 };
    for (who, may_operate, may_own) in [("alan", false, false), ("grace", true, false), ("ada", true, true)] {
        let remote = visit(folder.path(), who, &bridge);
        let (greeting, _) = remote.wait_for_run(&NEVER).unwrap().expect("every member may see");
        assert_eq!(greeting.title, "Far away", "{who}");
        let requests = remote.requests();
        let before = host.asked.0.lock().unwrap().len();
        assert_eq!(requests.run(weight()).is_ok(), may_operate, "{who}");
        assert_eq!(host.asked.0.lock().unwrap().len() > before, may_operate, "{who}");
        assert_eq!(requests.run(Request::EmergencyStop), Ok(()), "{who}: anybody presses it");
        assert_eq!(requests.run(Request::Release).is_ok(), may_own, "{who}");
    }
}

#[test]
fn who_is_no_member_is_refused() {
    let host = FakeHost::start();
    let (_folder, bridge) = closed(&host);
    let elsewhere = tempfile::tempdir().unwrap();
    write_keys(elsewhere.path(), &members()).unwrap();
    // The right name, vouched for by somebody else; then no certificate at all.
    for config in [Some(elsewhere.path().join("ada.json5")), None] {
        let connect = vec![bridge.endpoint.clone()];
        let link = LinkOptions { config, connect, ..LinkOptions::default() };
        match open(&link, End::Visiting) {
            Err(_) => {}
            Ok(session) => {
                let remote = Remote::listen(&session, &bridge.name).unwrap();
                assert_eq!(remote.status().unwrap(), None, "nothing is told");
                assert!(remote.requests().run(Request::EmergencyStop).is_err());
            }
        }
    }
    assert_eq!(host.asked.0.lock().unwrap().len(), 0);
}

#[test]
fn members_cannot_pretend_to_be_the_bridge() {
    let host = FakeHost::start();
    let (folder, bridge) = closed(&host);
    let honest = visit(folder.path(), "alan", &bridge);
    honest.wait_for_run(&NEVER).unwrap();
    let session = open(&link_of(folder.path(), "ada", &bridge), End::Visiting).unwrap();
    let lie = serde_json::to_vec(&flotor_live::End {
        words: "a lie".to_owned(),
        kind: flotor_live::EndKind::InOrder,
    })
    .unwrap();
    for _ in 0..20 {
        session.put(bridge.name.key("end"), lie.clone()).wait().unwrap();
    }
    assert_eq!(honest.next(Duration::from_millis(500)), None);
}

#[test]
fn members_ask_under_their_own_names_only() {
    let host = FakeHost::start();
    let (folder, bridge) = closed(&host);
    let session = open(&link_of(folder.path(), "grace", &bridge), End::Visiting).unwrap();
    assert_eq!(session.member(), &name("grace"));
    assert!(session.days_left().is_some_and(|days| (363..=365).contains(&days)));
    let remote = Remote::listen(&session, &bridge.name).unwrap();
    remote.wait_for_run(&NEVER).unwrap();
    let status = remote.status().unwrap().expect("every member may see");
    let ask = |member: &str| {
        let request = Request::Weight { model: "spring".to_owned(), weight: 0.5 };
        let numbered = NumberedRequest {
            session: "tester".to_owned(),
            number: 1,
            run: status.run,
            ticket: status.ticket,
            request,
        };
        let key = bridge.name.key(&format!("ask/weight/{member}"));
        let answers =
            session.get(key).payload(numbered.to_bytes()).timeout(Duration::from_secs(1)).wait().unwrap();
        answers.iter().filter(|answer| answer.result().is_ok()).count()
    };
    assert_eq!((ask("ada"), ask("**"), ask("grace")), (0, 0, 1));
}

#[test]
fn keys_of_before_there_were_stop_keys_are_known() {
    let folder = tempfile::tempdir().unwrap();
    write_keys(folder.path(), &members()).unwrap();
    let file = folder.path().join("bridge.json5");
    let lacks = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let listen = vec![format!("tls/localhost:{}", free_port())];
        let link = LinkOptions { config: Some(file.clone()), listen, ..LinkOptions::default() };
        open(&link, End::Serving).unwrap().lacks_stop_keys()
    };
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(!lacks(&text));
    let mut before: serde_json::Value = serde_json::from_str(&text).unwrap();
    before["metadata"].as_object_mut().unwrap().remove("stop_keys").expect("it has some");
    assert!(lacks(&before.to_string()));
}

#[test]
fn keys_are_secret_and_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    write_keys(folder.path(), &members()).unwrap();
    for who in ["bridge", "ada"] {
        let mode = std::fs::metadata(folder.path().join(format!("{who}.key"))).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{who}");
    }
    let key = std::fs::read(folder.path().join("ada.key")).unwrap();
    assert!(matches!(write_keys(folder.path(), &members()), Err(AccessError::File { .. })));
    assert_eq!(std::fs::read(folder.path().join("ada.key")).unwrap(), key);

    let mut twice = members();
    twice.peers.push((name("ada"), Right::Watch));
    let other = tempfile::tempdir().unwrap();
    assert!(matches!(write_keys(other.path(), &twice), Err(AccessError::Twice(_))));
    wait_until("nothing was written", || std::fs::read_dir(other.path()).unwrap().count() == 0);
}
