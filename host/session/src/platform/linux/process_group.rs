//! Process group whose leader is killed when its parent ends.
#![allow(unsafe_code)] // calls between `fork` and `exec`; tests/tests/system/architecture.rs lists it

use rustix::process::{
    Pid, Signal, WaitId, WaitIdOptions, getpid, getppid, kill_process_group, set_parent_process_death_signal,
    waitid,
};
use std::io;
use std::mem::MaybeUninit;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};

/// Makes the process of a command the leader of a new process group. The system kills the leader when the thread that starts it ends.
pub(crate) fn lead_until_parent_ends(command: &mut Command) {
    end_with_this_thread(command.process_group(0));
}

/// Makes the system kill the process of a command when the thread that starts it ends, for any reason. The process starts with no
/// signal blocked: the thread may therefore block all signals while it starts the process. Not real-time.
pub fn end_with_this_thread(command: &mut Command) {
    let parent = getpid();
    let end_with_parent = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        block_no_signal();
        // The system sends no signal for a parent that has already ended.
        if getppid() == Some(parent) { Ok(()) } else { Err(io::ErrorKind::NotFound.into()) }
    };
    // SAFETY: system calls alone, without a lock or an allocation.
    unsafe { command.pre_exec(end_with_parent) };
}

/// Unblocks every signal in this thread.
fn block_no_signal() {
    let mut none = MaybeUninit::<libc::sigset_t>::zeroed();
    // SAFETY: a set on this stack that the first call initialises, and a null pointer where nothing is to be written.
    unsafe {
        libc::sigemptyset(none.as_mut_ptr());
        libc::pthread_sigmask(libc::SIG_SETMASK, none.as_ptr(), std::ptr::null_mut());
    }
}

/// Returns true once a child has ended, without reaping it.
pub(crate) fn has_ended(child: &mut Child) -> io::Result<bool> {
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    Ok(waitid(WaitId::Pid(Pid::from_child(child)), options)?.is_some())
}

/// Kills the process group of a child that has not been reaped.
pub(crate) fn kill(child: &mut Child) {
    let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
}

#[cfg(test)]
mod tests {
    use crate::PluginProcess;
    use rustix::process::{Pid, test_kill_process};
    use std::io::{BufRead, BufReader, Read};
    use std::process::{ChildStdout, Command, Stdio};

    /// A shell that starts a process which ignores every request to end, prints its number, and goes on with `then`.
    fn shell(then: &str) -> (PluginProcess, Pid, BufReader<ChildStdout>) {
        let script = format!("(trap '' HUP INT TERM; exec sleep 600) & echo $!; {then}");
        let mut command = Command::new("sh");
        let mut process = PluginProcess::start(command.args(["-c", &script]).stdout(Stdio::piped()))
            .expect("there is a shell");
        let mut output = BufReader::new(process.child.stdout.take().expect("it is piped"));
        let mut line = String::new();
        output.read_line(&mut line).expect("the shell prints a line");
        let started = line.trim().parse().ok().and_then(Pid::from_raw).expect("a number");
        (process, started, output)
    }

    /// Waits for the end of a process: the last that holds the pipe.
    fn is_over(mut output: BufReader<ChildStdout>) -> bool {
        output.read_to_end(&mut Vec::new()).is_ok()
    }

    #[test]
    fn the_end_of_a_process_is_the_end_of_all_that_it_started() {
        let (mut ended, _, output) = shell("exit 7");
        assert_eq!(ended.wait().expect("it is ours").code(), Some(7));
        assert_eq!(ended.try_wait().expect("it is known").and_then(|status| status.code()), Some(7));
        assert!(is_over(output));
        let (mut killed, started, output) = shell("sleep 600");
        assert!(killed.try_wait().expect("it is ours").is_none() && test_kill_process(started).is_ok());
        killed.kill().expect("it is ours");
        assert!(is_over(output));
        let (dropped, _, output) = shell("sleep 600");
        drop(dropped);
        assert!(is_over(output));
    }

    #[test]
    fn a_process_ends_with_the_thread_that_started_it() {
        let mut command = Command::new("sleep");
        let command = command.arg("600").stdout(Stdio::piped());
        let thread = || PluginProcess::start(command).expect("it starts");
        let mut process =
            std::thread::scope(|scope| scope.spawn(thread).join()).expect("the thread only starts it");
        assert!(is_over(BufReader::new(process.child.stdout.take().expect("it is piped"))));
        assert!(process.wait().expect("it is ours").code().is_none(), "a signal ended it");
    }
}
