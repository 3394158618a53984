use super::*;

fn latch() -> (tempfile::TempDir, Directory, Latch) {
    let scratch = tempfile::tempdir().unwrap();
    let directory = Directory::at(scratch.path().join("runs"));
    let latch = directory.latch();
    (scratch, directory, latch)
}

#[test]
fn a_press_stays_until_it_is_released_and_is_never_forgotten() {
    let (_scratch, directory, latch) = latch();
    let first = latch.state();
    assert_eq!(first, LatchState::default());
    assert_eq!(latch.release("nobody").unwrap(), None);
    latch.press("first").unwrap();
    latch.press("second").unwrap();
    let state = directory.latch().state();
    assert_eq!(state.pressed.clone().unwrap().source, "first");
    assert_eq!(latch.release("owner").unwrap().unwrap().source, "first");
    let released = latch.state();
    assert_eq!(released.pressed, None);
    assert!(released.was_pressed_after(&first) && !released.was_pressed_after(&state));
    latch.press("third").unwrap();
    assert!(latch.state().was_pressed_after(&released));
    assert!(latch.state().pressed.unwrap().to_string().starts_with("third, 0 s ago"));
}

#[test]
fn a_release_undoes_no_press_that_it_did_not_see() {
    let (_scratch, directory, latch) = latch();
    latch.press("seen").unwrap();
    let (seen, _) = last_press(latch.kept.file.as_ref().unwrap()).unwrap();
    press(latch.kept.file.as_ref().unwrap(), "unseen").unwrap();
    let release = Entry::Release { press: seen, who: "owner".to_owned() };
    write(latch.kept.file.as_ref().unwrap(), Place::Release, &release).unwrap();
    assert_eq!(directory.latch().state().pressed.unwrap().source, "unseen");
}

#[test]
fn what_cannot_be_read_is_a_press_and_can_be_released() {
    let (_scratch, directory, latch) = latch();
    for nonsense in ["{", "{\"press\":{}}", "{\"lift\":{}}", "\0"] {
        let before = latch.state();
        let file = OpenOptions::new().write(true).open(latch.path()).unwrap();
        write_all_at(&file, nonsense.as_bytes(), 0).unwrap();
        let state = latch.state();
        assert!(state.pressed.is_some() && state.was_pressed_after(&before), "{nonsense:?}");
        latch.release("owner").unwrap();
        assert_eq!(directory.latch().state().pressed, None, "{nonsense:?}");
    }
    std::fs::write(latch.path(), "{").unwrap();
    let opened = directory.latch();
    assert!(opened.state().pressed.is_some(), "its room is taken behind what stands there");
    let longest = "\u{10ffff}".repeat(10_000);
    opened.release("owner").unwrap();
    opened.press(&longest).unwrap();
    assert_eq!(directory.latch().state().pressed.unwrap().source.chars().count(), LONGEST_NAME);
}

/// Whoever opened it before and whoever opens it later: both learn of a press behind a file that was replaced in between.
#[test]
fn a_press_reaches_those_before_and_after_the_file_was_replaced() {
    let (_scratch, directory, before) = latch();
    let other = directory.latch();
    std::fs::remove_dir_all(directory.path()).unwrap();
    assert_eq!(before.state(), LatchState::default());
    let after = directory.latch();
    before.press("first").unwrap();
    for latch in [&other, &after, &directory.latch()] {
        assert_eq!(latch.state().pressed.unwrap().source, "first");
    }
    before.release("owner").unwrap();
    assert_eq!([other.state().pressed, after.state().pressed], [None, None]);
    after.press("second").unwrap();
    assert_eq!(before.state().pressed.unwrap().source, "second");
}
