//! Division of a process: the child executes the command, the parent supervises the child.
#![allow(unsafe_code)] // `fork`, the word that both share, and the sender of a signal; tests/tests/system/architecture.rs lists it

use crate::supervision::{End, Side};
use flotor_servo::enter_guard_priority;
use flotor_servo::last_stop::ReportedEnd;
use flotor_servo::platform::{all_but, set_blocked, set_of};
use libc::{c_int, siginfo_t};
use rustix::mm::{MapFlags, ProtFlags, mmap_anonymous};
use rustix::process::{
    Pid, Signal, WaitOptions, WaitStatus, getpid, getppid, kill_process, set_parent_process_death_signal,
    waitpid,
};
use std::io;
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicI32, AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Poll interval of the supervisor; signals and the end of the child wake it at once.
const POLL: libc::timespec = libc::timespec { tv_sec: 1, tv_nsec: 0 };
const AT_ONCE: libc::timespec = libc::timespec { tv_sec: 0, tv_nsec: 0 };
/// Time limit for the child to end after its report: functions that plugins have registered with `atexit` run meanwhile.
const END_PATIENCE: Duration = Duration::from_secs(5);
/// Signals with which a terminal suspends a process.
const SUSPENDING: [c_int; 3] = [libc::SIGTSTP, libc::SIGTTIN, libc::SIGTTOU];

/// Signals with which a user or a process manager ends a process; a shell ignores some of them for commands in the background.
const INTERRUPTS: [c_int; 3] = [libc::SIGINT, libc::SIGQUIT, libc::SIGTERM];

/// Process id of the supervisor, in its child; 0 in a process without a supervisor.
static SUPERVISOR: AtomicI32 = AtomicI32::new(0);

/// Restores the default action of SIGINT, SIGQUIT and SIGTERM, which this process may have inherited as ignored. SIGHUP stays
/// ignored, for `nohup`. Not real-time.
pub(crate) fn accept_interrupts() {
    for signal in INTERRUPTS {
        // SAFETY: the default action.
        unsafe { libc::signal(signal, libc::SIG_DFL) };
    }
}

/// Forks this process, which must have one thread only. In the parent, supervises the child and returns once the child has ended.
/// Process 1 is not divided: in a container its end kills all other processes at once, the watchdog process too, and only the
/// descriptors of process 1 are closed before. So the watchdog process still detects the end of a host that is process 1, but would
/// be killed together with a child of process 1. `flotor doctor` reports this.
///
/// # Errors
/// If the system cannot map the shared memory or create the process; in the child, if the system cannot bind the child's life to
/// the supervisor.
pub(crate) fn divide() -> io::Result<Side> {
    if getpid() == Pid::INIT {
        return Ok(Side::Undivided);
    }
    let report = shared_word()?;
    let parent = getpid();
    // SIGCHLD may have been inherited as ignored: the end of the child would then not be reported. SAFETY: the default action.
    unsafe { libc::signal(libc::SIGCHLD, libc::SIG_DFL) };
    // Signals are pending until there is a child to forward them to.
    let before = set_blocked(&all_but(&[]));
    // SAFETY: this process has one thread, so that no lock is held in the child.
    let child = unsafe { libc::fork() };
    if child < 0 {
        let cause = io::Error::last_os_error();
        set_blocked(&before);
        return Err(cause);
    }
    match Pid::from_raw(child) {
        None => {
            SUPERVISOR.store(parent.as_raw_nonzero().get(), Ordering::Relaxed);
            set_parent_process_death_signal(Some(Signal::TERM))?;
            set_blocked(&before);
            if is_orphaned() {
                die_by(libc::SIGTERM);
            }
            Ok(Side::Child { supervisor: parent.as_raw_nonzero().get().cast_unsigned(), report })
        }
        Some(child) => Ok(Side::Supervisor(supervise(child, report))),
    }
}

/// Returns true if the supervisor of this process has ended.
pub(crate) fn is_orphaned() -> bool {
    match SUPERVISOR.load(Ordering::Relaxed) {
        0 => false,
        supervisor => getppid() != Pid::from_raw(supervisor),
    }
}

/// Ends this process by a signal, with its default action.
pub(crate) fn die_by(signal: c_int) -> ! {
    // SAFETY: the default action, then an initialised set, then no arguments.
    unsafe {
        libc::signal(signal, libc::SIG_DFL);
        libc::raise(signal);
    }
    set_blocked(&set_of(&[]));
    std::process::exit(128 + signal)
}

/// Forwards signals to the child, waits for its end and returns it.
fn supervise(child: Pid, report: &AtomicU32) -> End {
    enter_guard_priority();
    // A terminal signal that arrived before the fork has not reached the child.
    while let Some(info) = next_signal(AT_ONCE) {
        if info.si_signo != libc::SIGCHLD {
            send(child, &info);
        }
    }
    let mut reported: Option<Instant> = None;
    loop {
        while let Ok(Some((_, status))) = waitpid(Some(child), WaitOptions::NOHANG | WaitOptions::UNTRACED) {
            match status.stopping_signal() {
                Some(signal) => suspend_with(child, signal),
                None => return end_of(status, ReportedEnd::read(report)),
            }
        }
        if let Some(end) = ReportedEnd::read(report)
            && reported.get_or_insert_with(Instant::now).elapsed() > END_PATIENCE
        {
            let _ = kill_process(child, Signal::KILL);
            let _ = waitpid(Some(child), WaitOptions::empty());
            return match end {
                ReportedEnd::Code(code) => End::Reported(code),
                ReportedEnd::Signal => End::Killed(libc::SIGKILL),
            };
        }
        if let Some(info) = next_signal(POLL) {
            forward(child, &info);
        }
    }
}

/// Returns the end of the child from its status and its report.
fn end_of(status: WaitStatus, report: Option<ReportedEnd>) -> End {
    let code = status.exit_status().and_then(|code| u8::try_from(code).ok());
    let signal = status.terminating_signal().unwrap_or_default();
    match (report, code) {
        (Some(ReportedEnd::Code(0)), None) => End::Killed(signal),
        (Some(ReportedEnd::Code(reported)), _) => End::Reported(reported),
        (Some(ReportedEnd::Signal), Some(code)) => End::Reported(code),
        (Some(ReportedEnd::Signal), None) => End::Asked(signal),
        (None, Some(code)) => End::Left(code),
        (None, None) if is_request(signal) => End::Asked(signal),
        (None, None) => End::Killed(signal),
    }
}

/// Returns true for a signal that requests an end: its sender expects no message.
fn is_request(signal: c_int) -> bool {
    [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGQUIT, libc::SIGPIPE].contains(&signal)
}

/// Forwards a signal that the child has not received itself. Keys of a terminal signal the whole process group, but a closing
/// terminal signals only the leader of the session.
fn forward(child: Pid, info: &siginfo_t) {
    let is_of_a_process = info.si_code <= 0;
    match info.si_signo {
        libc::SIGCHLD => {}
        libc::SIGCONT | libc::SIGHUP => send(child, info),
        _ if is_of_a_process => send(child, info),
        _ => {}
    }
}

/// Sends a signal to the child with the process id of its original sender, for the child's messages.
fn send(child: Pid, info: &siginfo_t) {
    let mut queued = *info;
    queued.si_code = libc::SI_QUEUE;
    // SAFETY: a description of a signal that is there for the call.
    unsafe {
        libc::syscall(
            libc::SYS_rt_sigqueueinfo,
            child.as_raw_nonzero().get(),
            info.si_signo,
            &raw const queued,
        );
    }
}

/// Suspends this process if the terminal has suspended its child, as the shell expects, and continues the child once this process
/// is continued. A child stopped by another program is continued by that program.
fn suspend_with(child: Pid, signal: c_int) {
    if SUSPENDING.contains(&signal) {
        let _ = kill_process(getpid(), Signal::STOP);
        let _ = kill_process(child, Signal::CONT);
    }
}

/// Maps a zeroed word that this process shares with its children.
fn shared_word() -> io::Result<&'static AtomicU32> {
    let protection = ProtFlags::READ | ProtFlags::WRITE;
    // SAFETY: a new mapping at an address of the system's choice aliases nothing.
    let address = unsafe {
        mmap_anonymous(std::ptr::null_mut(), size_of::<AtomicU32>(), protection, MapFlags::SHARED)
    }?;
    // SAFETY: mapped for as long as the process lives, aligned to a page, zero, and used as an atomic alone.
    Ok(unsafe { &*address.cast::<AtomicU32>() })
}

/// Waits for a signal; `None` after the timeout.
fn next_signal(timeout: libc::timespec) -> Option<siginfo_t> {
    let every = all_but(&[]);
    let mut info = MaybeUninit::<siginfo_t>::zeroed();
    // SAFETY: an initialised set and time, and memory that is there for the call.
    let signal = unsafe { libc::sigtimedwait(&raw const every, info.as_mut_ptr(), &raw const timeout) };
    // SAFETY: plain data, all of whose bits may be zero, and written where there was a signal.
    (signal > 0).then(|| unsafe { info.assume_init() })
}
