//! Playback: the displayed time, the newest of a running host or any earlier one.

/// Playback speeds of a recording, in multiples of real time.
pub const SPEEDS: [f64; 6] = [0.05, 0.1, 0.25, 0.5, 1.0, 2.0];

/// Playback mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Follow the newest sample.
    Follow,
    /// Advance with the wall clock.
    Play,
    /// Stay at the displayed time.
    Pause,
}

/// Displayed time and playback mode.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Player {
    /// Displayed time, s.
    pub now_s: f64,
    /// Playback mode.
    pub motion: Motion,
    /// Playback speed, in multiples of real time.
    pub speed: f64,
    /// True if playback restarts at the end.
    pub repeats: bool,
}

impl Player {
    /// Creates a player that follows a running host.
    pub fn live() -> Self {
        Self { now_s: 0.0, motion: Motion::Follow, speed: 1.0, repeats: false }
    }

    /// Creates a player that is paused at a time of a recording, s.
    pub fn at(now_s: f64) -> Self {
        Self { now_s, motion: Motion::Pause, speed: 1.0, repeats: true }
    }

    /// Advances the displayed time by elapsed wall-clock time, within the first and last time of the samples.
    pub fn advance(&mut self, elapsed_s: f64, [first_s, last_s]: [f64; 2]) {
        match self.motion {
            Motion::Follow => self.now_s = last_s,
            Motion::Pause => self.now_s = self.now_s.clamp(first_s, last_s.max(first_s)),
            Motion::Play => {
                self.now_s = (self.now_s + elapsed_s * self.speed).max(first_s);
                if self.now_s >= last_s {
                    let length_s = last_s - first_s;
                    if self.repeats && length_s > 0.0 {
                        self.now_s = first_s + (self.now_s - first_s) % length_s;
                    } else {
                        (self.now_s, self.motion) = (last_s, Motion::Pause);
                    }
                }
            }
        }
    }

    /// Moves to a time, s, limited to the time span of the samples. A player that follows the newest sample is paused; playback
    /// continues from the new time.
    pub fn seek(&mut self, now_s: f64, [first_s, last_s]: [f64; 2]) {
        self.now_s = now_s.clamp(first_s, last_s.max(first_s));
        if self.motion == Motion::Follow {
            self.motion = Motion::Pause;
        }
    }

    /// Pauses a following player at the last time, when no newer samples will come.
    pub fn stop_following(&mut self, [_, last_s]: [f64; 2]) {
        if self.motion == Motion::Follow {
            (self.now_s, self.motion) = (last_s, Motion::Pause);
        }
    }

    /// Starts or pauses playback: restarts a recording that is at its end, and follows a running host again.
    pub fn toggle(&mut self, is_live: bool, [first_s, last_s]: [f64; 2]) {
        self.motion = match self.motion {
            Motion::Follow | Motion::Play => Motion::Pause,
            Motion::Pause if is_live => Motion::Follow,
            Motion::Pause => {
                if self.now_s >= last_s {
                    self.now_s = first_s;
                }
                Motion::Play
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPAN: [f64; 2] = [1.0, 3.0];

    #[test]
    fn playing_ends_or_begins_again() {
        let mut player = Player { motion: Motion::Play, repeats: false, ..Player::at(2.0) };
        player.advance(0.5, SPAN);
        assert_eq!((player.now_s, player.motion), (2.5, Motion::Play));
        player.advance(9.0, SPAN);
        assert_eq!((player.now_s, player.motion), (3.0, Motion::Pause));
        player.toggle(false, SPAN);
        assert_eq!((player.now_s, player.motion), (1.0, Motion::Play), "from the beginning");
        let mut again = Player { motion: Motion::Play, speed: 2.0, ..Player::at(2.5) };
        again.advance(0.5, SPAN);
        assert_eq!(again.now_s, 1.5, "once around");
    }

    #[test]
    fn a_running_host_is_followed_until_somebody_looks_back() {
        let mut player = Player::live();
        player.advance(0.1, SPAN);
        assert_eq!(player.now_s, 3.0);
        player.seek(0.0, SPAN);
        player.advance(0.1, [1.5, 3.1]);
        assert_eq!((player.now_s, player.motion), (1.5, Motion::Pause), "the past that is kept moves on");
        player.toggle(true, SPAN);
        assert_eq!(player.motion, Motion::Follow);
    }

    #[test]
    fn a_run_that_is_over_is_played_from_its_beginning() {
        let mut player = Player::live();
        player.stop_following(SPAN);
        assert_eq!((player.now_s, player.motion), (3.0, Motion::Pause));
        player.toggle(false, SPAN);
        assert_eq!((player.now_s, player.motion), (1.0, Motion::Play));
        player.stop_following(SPAN);
        assert_eq!(player.motion, Motion::Play, "who looks back goes on looking");
    }

    #[test]
    fn a_run_without_length_stands_still() {
        let mut player = Player { motion: Motion::Play, ..Player::at(0.0) };
        player.advance(1.0, [0.0, 0.0]);
        assert_eq!(player.now_s, 0.0, "nothing to play");
    }
}
