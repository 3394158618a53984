use super::*;

#[test]
fn a_beat_tells_tick_and_place() {
    let heartbeat = Heartbeat::default();
    for place in [
        Place::Waiting,
        Place::Host,
        Place::DeviceWait(0),
        Place::DeviceWait(MAX_DEVICES - 1),
        Place::DeviceRead(0),
        Place::DeviceRead(MAX_DEVICES - 1),
        Place::DeviceWrite(0),
        Place::DeviceWrite(MAX_DEVICES - 1),
        Place::Model(0),
        Place::Model(9999),
    ] {
        heartbeat.enter(123_456_789_012, place);
        assert_eq!(Stuck::at(heartbeat.beat()), Stuck { tick: 123_456_789_012, place });
    }
}

#[test]
fn after_a_stop_from_beside_no_command_begins_and_none_is_under_way() {
    let (heartbeat, under_way) = (Heartbeat::default(), Arc::new(AtomicBool::new(false)));
    let (loops, commands) = (heartbeat.clone(), Arc::clone(&under_way));
    let thread = std::thread::spawn(move || {
        let mut sent = 0_u64;
        for tick in 0.. {
            loops.enter(tick, Place::DeviceWrite(0));
            if loops.is_silenced() {
                return sent;
            }
            commands.store(true, Ordering::Relaxed);
            sent += 1;
            std::hint::spin_loop();
            commands.store(false, Ordering::Relaxed);
            loops.enter(tick, Place::Waiting);
        }
        sent
    });
    while heartbeat.beat() >> PLACE_BITS < 1000 {
        std::thread::yield_now();
    }
    let begun_ns = monotonic_ns();
    heartbeat.silence();
    // A thread that the system keeps from running in its command for so long is not waited for.
    let had_to_wait = monotonic_ns() - begun_ns >= LONGEST_COMMAND_NS;
    assert!(had_to_wait || !under_way.load(Ordering::Acquire));
    assert!(thread.join().expect("it ends") >= 1000);
}

#[test]
fn the_first_beat_can_be_bitten_too() {
    let heartbeat = Heartbeat::default();
    assert_eq!(heartbeat.fired_at(), None);
    heartbeat.fire(0);
    assert_eq!(heartbeat.fired_at(), Some(Stuck { tick: 0, place: Place::Waiting }));
}
