//! A bridge and its visitors on one machine: what arrives, what is refused, what is lost.

mod common;

use common::{Bridge, FakeHost, PATIENCE, SLOW, description, is_full_size, record, wait_until};
use flotor_bridge::attach::attach;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::record::{RecordingEnd, record as record_remote};
use flotor_bridge::remote::{Remote, RemoteEvent, bridges};
use flotor_bridge::request::{MAX_REQUEST_BYTES, NumberedRequest, Refusal, Request, Right};
use flotor_bridge::status::State;
use flotor_live::{Ask, Client, Directory, Event, SetValue};
use flotor_record::Recording;
use flotor_sync::Words;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use zenoh::Wait;

static NEVER: AtomicBool = AtomicBool::new(false);

/// Ticks at 1 kHz: a minute at full size.
fn ticks() -> u64 {
    if is_full_size() { 60_000 } else { 3000 }
}

/// A visitor who hears ticks.
fn listening(bridge: &Bridge, host: &FakeHost) -> Remote {
    let remote = bridge.visit();
    remote.wait_for_run(&NEVER).unwrap().expect("nobody stops it");
    // Ticks from 2^40 on are no part of a test: they are sent until one has arrived.
    let mut probe = 1 << 40;
    wait_until("the visitor hears", || {
        host.publication().observe(&record(probe));
        probe += 1;
        matches!(remote.next(Duration::from_millis(50)), Some(RemoteEvent::Tick(_)))
    });
    remote
}

fn set(parameter: &str) -> Request {
    let [plugin, parameter, value] = ["spring", parameter, "20"].map(str::to_owned);
    Request::Set { values: vec![SetValue { plugin, parameter, value }] }
}

#[test]
fn every_tick_arrives_to_the_bit() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Watch);
    let remote = listening(&bridge, &host);
    let total = ticks();
    let (heard, remote) = std::thread::scope(|scope| {
        let heard = scope.spawn(move || {
            let mut heard = Vec::new();
            let until = Instant::now() + Duration::from_millis(total) + PATIENCE;
            while heard.len() < total as usize && Instant::now() < until {
                if let Some(RemoteEvent::Tick(tick)) = remote.next(Duration::from_millis(100))
                    && tick.tick < 1 << 40
                {
                    heard.push(tick);
                }
            }
            (heard, remote)
        });
        host.ticks(0..total);
        heard.join().unwrap()
    });
    assert_eq!((heard.len() as u64, remote.lost()), (total, 0));
    for (tick, heard) in (0..).zip(&heard) {
        assert_eq!(heard.to_words(), record(tick).to_words());
    }
    let status = remote.status().unwrap().expect("the bridge is there");
    assert_eq!((status.state, status.dropped), (State::Running, 0));
}

#[test]
fn what_the_host_drops_and_what_a_slow_visitor_misses_are_losses_and_the_end_is_told() {
    /// More than wait for a bridge, and more than wait for a visitor.
    const TICKS: u64 = 30_000;
    let mut host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Watch);
    let remote = listening(&bridge, &host);
    (0..TICKS).for_each(|tick| host.publication().observe(&record(tick)));
    let published = || remote.status().unwrap().expect("the bridge is there").published;
    wait_until("the bridge has told all", || {
        let before = published();
        std::thread::sleep(Duration::from_millis(300));
        published() == before
    });
    host.end("enough");
    let (mut heard, mut words) = (0, None);
    wait_until("the end is heard", || {
        while let Some(event) = remote.next(Duration::from_millis(10)) {
            match event {
                RemoteEvent::Tick(tick) if tick.tick < 1 << 40 => heard += 1,
                RemoteEvent::End(end) => words = Some(end.words),
                _ => {}
            }
        }
        words.is_some()
    });
    let dropped = remote.status().unwrap().expect("the bridge is there").dropped;
    assert!(dropped > 0, "a host whose queue never fills proves nothing");
    assert_eq!((heard + remote.lost(), words.as_deref()), (TICKS, Some("enough")), "{dropped} dropped");
}

#[test]
fn nothing_is_put_on_the_network_while_nobody_subscribes() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Watch);
    let link = LinkOptions { connect: vec![bridge.endpoint.clone()], ..LinkOptions::default() };
    let session = open(&link, End::Visiting).unwrap();
    wait_until("the bridge is seen", || bridges(&session).unwrap() == [bridge.name.clone()]);
    host.ticks(0..500);
    let status = session.get(bridge.name.key("status")).wait().unwrap().recv().unwrap();
    let status = status.into_result().unwrap().payload().to_bytes().into_owned();
    let status: flotor_bridge::status::Status = serde_json::from_slice(&status).unwrap();
    assert_eq!((status.published, status.state), (0, State::Running));
}

#[test]
fn who_comes_late_knows_all_that_is_needed() {
    let host = FakeHost::start();
    host.ticks(0..50);
    let bridge = Bridge::start(&host.directory, Right::Watch);
    let remote = bridge.visit();
    let (greeting, run) = remote.wait_for_run(&NEVER).unwrap().expect("nobody stops it");
    assert_eq!((greeting.title.as_str(), run), ("Far away", description()));
}

#[test]
fn requests_reach_the_host_and_its_message_come_back() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Operate);
    let remote = bridge.visit();
    remote.wait_for_run(&NEVER).unwrap();
    let requests = remote.requests();
    assert_eq!(requests.run(set("gamma_n")), Ok(()));
    assert_eq!(requests.run(set("gamma")), Err("no parameter `gamma`; did you mean `gamma_n`?".to_owned()));
    assert_eq!(requests.run(Request::EmergencyStop), Ok(()));
    let asked = host.asked.0.lock().unwrap().clone();
    assert!(matches!(asked.as_slice(), [Ask::Set { .. }, Ask::Set { .. }, Ask::MachineStop]), "{asked:?}");
    // Starting is the owner's, and this bridge does not let anybody.
    let refused = requests.run(Request::Start).unwrap_err();
    assert!(refused.contains("rejects `start`"), "{refused}");
}

#[test]
fn an_emergency_stop_stays_until_its_owner_releases_it() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Own);
    let remote = bridge.visit();
    remote.wait_for_run(&NEVER).unwrap();
    let requests = remote.requests();
    let state = || remote.status().unwrap().expect("the bridge is there").state;
    assert_eq!(requests.run(Request::EmergencyStop), Ok(()));
    assert_eq!(state(), State::EmergencyStopped);
    assert!(requests.run(Request::Start).unwrap_err().contains("release the emergency stop first"));
    assert_eq!(requests.run(Request::Release), Ok(()));
    assert_eq!(state(), State::Running);
}

#[test]
fn malformed_long_stale_and_replayed_requests_are_refused_and_counted() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Own);
    let remote = bridge.visit();
    let (greeting, _) = remote.wait_for_run(&NEVER).unwrap().expect("nobody stops it");
    let link = LinkOptions { connect: vec![bridge.endpoint.clone()], ..LinkOptions::default() };
    let session = open(&link, End::Visiting).unwrap();
    let ask = |key: &str, payload: Vec<u8>| {
        let answers = session.get(bridge.name.key(key)).payload(payload).timeout(PATIENCE).wait().unwrap();
        let answer = answers.recv().expect("the bridge answers").into_result().unwrap();
        let answer: flotor_live::Answer = serde_json::from_slice(&answer.payload().to_bytes()).unwrap();
        answer.refused
    };
    let ticket = remote.status().unwrap().expect("the bridge is there").ticket;
    let numbered = |number, run, request| {
        NumberedRequest { session: "tester".to_owned(), number, run, ticket, request }.to_bytes()
    };
    let good = numbered(5, greeting.process, Request::Stop);
    assert_eq!(ask("ask/stop/anyone", good.clone()), None);
    let before = host.asked.0.lock().unwrap().len();
    assert!(ask("ask/stop/anyone", good).is_some(), "replayed");
    assert!(ask("ask/stop/anyone", numbered(4, greeting.process, Request::Stop)).is_some(), "older");
    assert!(
        ask("ask/stop/anyone", numbered(6, greeting.process + 1, Request::Stop)).is_some(),
        "of another run"
    );
    assert!(
        ask("ask/emergency-stop/anyone", numbered(7, greeting.process, set("gamma_n"))).is_some(),
        "through the wrong door"
    );
    assert!(ask("ask/set/anyone", b"{".to_vec()).is_some(), "no letter");
    assert!(ask("ask/set/anyone", vec![b'x'; 4 * MAX_REQUEST_BYTES]).is_some(), "long");
    assert_eq!(host.asked.0.lock().unwrap().len(), before, "the host heard of none of them");
    let refused = remote.status().unwrap().expect("the bridge is there").refused;
    let expected =
        [(Refusal::Malformed, 2), (Refusal::TooLong, 1), (Refusal::Replayed, 2), (Refusal::Stale, 1)];
    assert_eq!(refused.into_iter().collect::<Vec<_>>(), expected);
}

#[test]
fn a_flood_of_requests_is_cut_short_and_the_emergency_stop_gets_past() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Operate);
    let remote = bridge.visit();
    remote.wait_for_run(&NEVER).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..64 {
            let requests = remote.requests();
            let request = Request::Weight { model: SLOW.to_owned(), weight: 0.5 };
            scope.spawn(move || requests.run(request));
        }
        wait_until("requests are refused", || {
            let status = remote.status().unwrap().expect("the bridge is there");
            status.refused.contains_key(&Refusal::Busy)
        });
        assert_eq!(remote.requests().run(Request::EmergencyStop), Ok(()));
    });
    let asked = host.asked.0.lock().unwrap();
    assert!(asked.contains(&Ask::MachineStop) && asked.len() < 64, "{} requests", asked.len());
}

#[test]
fn a_remote_run_can_be_watched_as_if_it_ran_here() {
    let mut host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Operate);
    let folder = tempfile::tempdir().unwrap();
    let here = Directory::at(folder.path().join("runs"));
    let (remote, stop) = (bridge.visit(), AtomicBool::new(false));
    let (folder_here, until) = (&here, &stop);
    std::thread::scope(|scope| {
        scope.spawn(move || attach(&remote, folder_here, until, &mut |_| {}).unwrap());
        wait_until("the run appears", || !here.runs().is_empty());
        let mut client = Client::find(&here).unwrap();
        assert_eq!(client.greeting().title, "Far away");
        client.request_client().ask(Ask::Watch { every: 1 }).unwrap();
        client.request_client().ask(Ask::Weight { model: "spring".to_owned(), weight: 0.5 }).unwrap();
        let mut tick = 0;
        let mut seen = 0;
        wait_until("ticks appear", || {
            host.ticks(tick..tick + 10);
            tick += 10;
            if let Some(Event::Ticks { records, .. }) = client.next(Duration::from_millis(20)).unwrap() {
                assert!(records.iter().all(|seen| seen.to_words() == record(seen.tick).to_words()));
                seen += records.len();
            }
            seen > 100
        });
        wait_until("the request arrives", || {
            host.asked.0.lock().unwrap().iter().any(|ask| matches!(ask, Ask::Weight { .. }))
        });
        // A stop of the runs of this machine does not confirm one that goes on elsewhere.
        client.request_client().ask(Ask::MachineStop).unwrap();
        let mut refused = None;
        wait_until("the stop is rejected", || {
            if let Ok(Some(Event::Answer(answer))) = client.next(Duration::from_millis(20)) {
                refused = answer.refused.or(refused.take());
            }
            refused.is_some()
        });
        assert!(refused.is_some_and(|words| words.contains("another machine")));
        assert!(!host.asked.0.lock().unwrap().contains(&Ask::MachineStop));
        host.end("enough");
        let mut words = None;
        wait_until("the end appears", || {
            if let Ok(Some(Event::End(end))) = client.next(Duration::from_millis(50)) {
                words = Some(end.words);
            }
            words.is_some()
        });
        assert_eq!(words.as_deref(), Some("enough"));
        stop.store(true, Ordering::Relaxed);
    });
}

#[test]
fn a_remote_run_is_recorded_whole_and_the_bridge_may_die() {
    let mut host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Watch);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let remote = listening(&bridge, &host);
    let recording = file.clone();
    let kept = std::thread::scope(|scope| {
        let kept = scope.spawn(move || record_remote(&remote, &recording, &NEVER).unwrap());
        wait_until("the recording begins", || file.exists());
        host.ticks(0..500);
        host.end("enough");
        kept.join().unwrap()
    });
    assert_eq!((kept.lost, kept.end), (0, RecordingEnd::Over("enough".to_owned())));
    let recording = Recording::open(&file).unwrap();
    assert_eq!(recording.run(), &description());
    let recorded: Vec<_> = recording
        .map(|tick| tick.unwrap())
        .filter(|tick| tick.tick < 1 << 40)
        .map(|tick| tick.tick)
        .collect();
    assert_eq!(recorded, (0..500).collect::<Vec<_>>());

    // The next run; this time the bridge goes first.
    host.run();
    let file = folder.path().join("broken.mcap");
    let remote = listening(&bridge, &host);
    let recording = file.clone();
    let kept = std::thread::scope(|scope| {
        let kept = scope.spawn(move || record_remote(&remote, &recording, &NEVER).unwrap());
        wait_until("the recording begins", || file.exists());
        drop(bridge);
        host.ticks(0..100); // the host does not mind
        kept.join().unwrap()
    });
    assert_eq!(kept.end, RecordingEnd::Cut);
    assert!(Recording::open(&file).is_ok(), "what was recorded is there");
}

#[test]
fn without_keys_only_the_bridge_tells_what_becomes_of_a_run() {
    let host = FakeHost::start();
    let bridge = Bridge::start(&host.directory, Right::Own);
    let listener = listening(&bridge, &host);
    let link = LinkOptions { connect: vec![bridge.endpoint.clone()], ..LinkOptions::default() };
    let forger = open(&link, End::Visiting).unwrap();
    let lie = serde_json::to_vec(&flotor_live::End {
        words: "a lie".to_owned(),
        kind: flotor_live::EndKind::InOrder,
    })
    .unwrap();
    for what in ["end", "tick", "tf", "change", "status", "news/pair"] {
        for _ in 0..20 {
            forger.put(bridge.name.key(what), lie.clone()).wait().unwrap();
        }
    }
    let _token = forger.liveliness().declare_token(bridge.name.key("alive")).wait().unwrap();
    drop(_token);
    let until = std::time::Instant::now() + Duration::from_millis(500);
    while std::time::Instant::now() < until {
        let event = listener.next(Duration::from_millis(50));
        assert!(event.is_none() || matches!(event, Some(RemoteEvent::Tick(_))), "{event:?}");
    }
    assert_eq!(listener.lost(), 0, "no forged tick was counted");
}
