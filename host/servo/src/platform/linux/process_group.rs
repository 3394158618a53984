//! Process group whose processes all end when its leader ends, and whose leader ends when its parent ends.
#![allow(unsafe_code)] // calls between `fork` and `exec`; tests/tests/system/architecture.rs lists it

use super::last_stop::{all_but, set_blocked, set_of};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::process::{
    Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, getpid, getppid, kill_current_process_group,
    kill_process_group, pidfd_open, set_parent_process_death_signal, waitid,
};
use std::ffi::{c_int, c_long};
use std::io;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};

/// Makes the process of a command the leader of a new process group, which terminal signals do not reach. The system kills the
/// leader when the thread that starts the leader ends; at the end of the leader, a guard (from Linux 5.3 on) kills the rest of the
/// group. Not real-time.
pub fn lead_until_parent_ends(command: &mut Command) {
    end_with_this_thread(command.process_group(0));
    // SAFETY: system calls alone, without a lock or an allocation.
    unsafe { command.pre_exec(start_guard) };
}

/// Makes the system kill the process of a command when the thread that starts it ends, for any reason. The process starts with no
/// signal blocked: the thread may therefore block all signals while it starts the process. Not real-time.
pub fn end_with_this_thread(command: &mut Command) {
    let parent = getpid();
    let end_with_parent = move || {
        set_parent_process_death_signal(Some(Signal::KILL))?;
        set_blocked(&set_of(&[]));
        // The system sends no signal for a parent that has already ended.
        if getppid() == Some(parent) { Ok(()) } else { Err(io::ErrorKind::NotFound.into()) }
    };
    // SAFETY: system calls alone, without a lock or an allocation.
    unsafe { command.pre_exec(end_with_parent) };
}

/// Starts the guard of the process group that this process leads: a copy of this process before `exec`. Before Linux 5.9, which has
/// the process descriptors and `close_range` that the guard needs, there is no guard: then the system kills the leader alone.
fn start_guard() -> io::Result<()> {
    let Ok(leader) = pidfd_open(getpid(), PidfdFlags::empty()) else { return Ok(()) };
    // No signal at its end: the guard is a child that `wait` does not find, so that the plugin has no child it did not start.
    const NO_SIGNAL: c_long = 0;
    // SAFETY: a copy with memory and stack of its own, which makes system calls without locks or allocations, and never returns.
    match unsafe { libc::syscall(libc::SYS_clone, NO_SIGNAL, 0, 0, 0, 0) } {
        0 => kill_group_at_end_of(leader.as_fd()),
        -1 => Err(io::Error::last_os_error()),
        _ => Ok(()),
    }
}

/// Waits for the end of the leader, and kills the group, this process included.
fn kill_group_at_end_of(leader: BorrowedFd<'_>) -> ! {
    set_blocked(&all_but(&[]));
    let _ = rustix::thread::set_name(c"flotor-guard");
    // Else a reader of the plugin's output would wait for the guard, and files of the host would be open for longer.
    if close_all_but(leader.as_raw_fd()).is_ok() {
        let mut end = [PollFd::from_borrowed_fd(leader, PollFlags::IN)];
        while poll(&mut end, None) == Err(Errno::INTR) {}
        let _ = kill_current_process_group(Signal::KILL);
    }
    // SAFETY: ends this copy without running anything else of the host.
    unsafe { libc::_exit(0) }
}

/// Closes all descriptors of this process but one.
fn close_all_but(kept: c_int) -> io::Result<()> {
    let close = |first: c_int, last: c_int| {
        // SAFETY: plain numbers; the caller uses no other descriptor.
        let code = unsafe { libc::syscall(libc::SYS_close_range, first, last, 0) };
        if code == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    };
    if kept > 0 {
        close(0, kept - 1)?;
    }
    close(kept + 1, c_int::MAX)
}

/// Returns true once a child has ended, without reaping it.
///
/// # Errors
/// If the system call fails.
pub fn has_ended(child: &mut Child) -> io::Result<bool> {
    let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    Ok(waitid(WaitId::Pid(Pid::from_child(child)), options)?.is_some())
}

/// Kills the process group of a child that has not been reaped.
pub fn kill(child: &mut Child) {
    let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
}
