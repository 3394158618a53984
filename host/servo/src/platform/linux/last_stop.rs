//! Last stop on Linux: handlers of fatal signals and of `exit`, with their alternate stack.
//!
//! Nothing that runs in a handler allocates, locks or formats into memory of its own.
#![allow(unsafe_code)] // handlers of deadly signals and of `exit` cannot be made without; tests/tests/system/architecture.rs

use crate::guest::{is_guest, program_handles_signals};
use crate::last_stop::{Death, end_if_armed, end_if_in_call, is_armed, is_in_call};
use flotor_core::lock;
use libc::{
    SIGABRT, SIGALRM, SIGBUS, SIGCHLD, SIGCONT, SIGFPE, SIGHUP, SIGILL, SIGINT, SIGIO, SIGKILL, SIGPIPE,
    SIGPROF, SIGPWR, SIGQUIT, SIGSEGV, SIGSTOP, SIGSYS, SIGTERM, SIGTRAP, SIGTSTP, SIGTTIN, SIGTTOU, SIGURG,
    SIGUSR1, SIGUSR2, SIGVTALRM, SIGWINCH, SIGXCPU, SIGXFSZ,
};
use libc::{c_int, c_void, sigaction, siginfo_t, sigset_t};
use std::io;
use std::mem::MaybeUninit;
use std::process::{Child, Command};
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Mutex, Once, OnceLock};
use std::time::Duration;

/// Signals of failed instructions and of `abort`, raised by the process itself.
const RAISED: [c_int; 7] = [SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS, SIGTRAP];
/// Signals that request the end of a process; a process without handlers ends by them, as the sender expects.
const ASKING: [c_int; 5] = [SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE];
/// Signals that end no process by themselves, or cannot be caught.
const HARMLESS: [c_int; 9] =
    [SIGKILL, SIGSTOP, SIGTSTP, SIGTTIN, SIGTTOU, SIGCHLD, SIGCONT, SIGURG, SIGWINCH];
/// Signals that a timer, a limit or another program sends to the process as a whole.
const SENT: [c_int; 7] = [SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU, SIGIO, SIGPWR];
/// Signals reserved for the host: signals of crashes, requests to end or suspend a run, the emergency stop.
const KEPT: [c_int; 15] = [
    SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGSYS, SIGTRAP, SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP,
    SIGTTIN, SIGTTOU, SIGUSR1,
];
/// Length of a table by signal number, 1 to 64; the C library reserves two of the numbers.
const SIGNALS: usize = 65;
/// Size of the alternate stack, bytes: frames of a handler with the widest registers take some 12 KiB, a device's stop little.
const STACK_BYTES: usize = 128 * 1024;
/// Capacity of a thread's name with its terminator, bytes.
pub(crate) const NAME_BYTES: usize = 16;

/// Process that armed a run: a copy made by `fork` does not own the devices.
static OWN_PROCESS: AtomicI32 = AtomicI32::new(0);

fn is_own_process() -> bool {
    OWN_PROCESS.load(Ordering::Acquire) == process_number()
}

/// Actions of the signals before our handler.
static BEFORE: [OnceLock<sigaction>; SIGNALS] = [const { OnceLock::new() }; SIGNALS];

/// Installs handlers for `exit`, for crash signals and for every other fatal signal without a handler, on an alternate stack of
/// this thread, and unblocks the signals of [`block_sent_signals`]. If the program of a guest handles all signals, only the handler
/// for `exit` is installed. Repeated for each run, because a plugin may have installed other handlers. Not real-time.
pub(crate) fn install() {
    install_for(|signal| !HARMLESS.contains(&signal));
    take_sent();
}

/// Installs handlers for the signals that this thread raises when it crashes, and for `exit`. Signals that request the end of the
/// process are not handled: the host has not yet chosen their receiver. Not real-time.
pub(crate) fn install_for_crashes() {
    install_for(|signal| RAISED.contains(&signal));
}

fn install_for(is_wanted: impl Fn(c_int) -> bool) {
    static AT_EXIT: Once = Once::new();
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = lock(&ONE_AT_A_TIME);
    OWN_PROCESS.store(process_number(), Ordering::Release);
    AT_EXIT.call_once(|| {
        // SAFETY: a function without arguments that may be called at the end of the process.
        let _ = unsafe { libc::atexit(at_exit) };
    });
    if program_handles_signals() {
        return;
    }
    STACK.with(|_| ());
    for signal in (1..).take(SIGNALS - 1).filter(|signal| is_wanted(*signal)) {
        let Some(found) = action(signal) else { continue };
        let is_ours = found.sa_sigaction == handler();
        if is_ours || found.sa_sigaction != libc::SIG_DFL && !RAISED.contains(&signal) {
            continue;
        }
        if let Some(before) = usize::try_from(signal).ok().and_then(|signal| BEFORE.get(signal)) {
            before.get_or_init(|| found);
        }
        let mut ours = found;
        ours.sa_sigaction = handler();
        ours.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK | libc::SA_NODEFER | libc::SA_RESTART;
        // A stop that crashes is caught; a timer that expires during a stop waits.
        ours.sa_mask = all_but(&RAISED);
        set_action(signal, &ours);
    }
}

/// Blocks signals that timers, limits or other programs send to the process as a whole, in the calling thread and in all threads
/// that it starts from now on: the loop and the watchdog, which have real-time priority, handle them. Not real-time.
///
/// # Errors
/// If the system call fails.
pub fn block_sent_signals() -> io::Result<()> {
    block_signals(&SENT)
}

/// Unblocks the signals of [`block_sent_signals`] in this thread, unless the host is a guest of a program that handles all signals
/// ([`Signals::Program`](crate::guest::Signals::Program)). Not real-time.
pub(crate) fn take_sent() {
    if program_handles_signals() {
        return;
    }
    unblock(&SENT);
}

fn handler() -> libc::sighandler_t {
    on_signal as extern "C" fn(c_int, *mut siginfo_t, *mut c_void) as libc::sighandler_t
}

extern "C" fn on_signal(signal: c_int, info: *mut siginfo_t, _: *mut c_void) {
    // SAFETY: the system passes the handler of a signal, installed with SA_SIGINFO, a description of it.
    let (code, sender) = unsafe { ((*info).si_code, (*info).si_pid()) };
    let was_sent = [libc::SI_USER, libc::SI_TKILL, libc::SI_QUEUE].contains(&code);
    let sender = Some(sender).filter(|sender| was_sent && *sender != process_number());
    if is_own_process() {
        let death = Death::Signal { signal, sender };
        end_if_armed(death);
        if RAISED.contains(&signal) && sender.is_none() {
            end_if_in_call(death);
        }
    }
    // No run is armed: restore the action from before our handler.
    let before = usize::try_from(signal).ok().and_then(|signal| BEFORE.get(signal)?.get());
    if let Some(before) = before {
        set_action(signal, before);
    }
    // A failed instruction is executed once more and raises its signal again.
    if code <= 0 || !RAISED.contains(&signal) {
        raise(signal);
    }
}

extern "C" fn at_exit() {
    if is_own_process() && (is_armed() || is_in_call()) {
        // A stop that calls `exit` itself is caught once more.
        // SAFETY: as where it was registered first.
        let _ = unsafe { libc::atexit(at_exit) };
        end_if_armed(Death::Exit);
        end_if_in_call(Death::Exit);
    }
}

/// Ends the process: by the signal that requested the end, if there was one; otherwise with `code`. In a guest the program's own
/// action for the signal comes first.
pub(crate) fn end_by(death: Death, code: i32) -> ! {
    if let Death::Signal { signal, .. } = death
        && is_guest()
        && let Some(before) = usize::try_from(signal).ok().and_then(|signal| BEFORE.get(signal)?.get())
    {
        // The program's own action: a handler or the default.
        set_action(signal, before);
        raise(signal);
    }
    if let Death::Signal { signal, .. } = death
        && ASKING.contains(&signal)
    {
        // SAFETY: plain data, all of whose bits may be zero: the default action.
        let default = unsafe { MaybeUninit::<sigaction>::zeroed().assume_init() };
        set_action(signal, &default);
        raise(signal);
    }
    exit_process(code)
}

/// Ends the process at once, without exit handlers. Real-time: never returns.
pub(crate) fn exit_process(code: i32) -> ! {
    // SAFETY: takes nothing and never returns.
    unsafe { libc::_exit(code) }
}

/// Sends a signal to the calling thread, which handles it before this function returns.
fn raise(signal: c_int) {
    // SAFETY: takes no memory; the handler of the signal may run at any time.
    unsafe { libc::raise(signal) };
    unblock(&[signal]);
}

/// Writes to standard error, once and without error handling: the reader may be closed.
pub(crate) fn say(bytes: &[u8]) {
    // SAFETY: the bytes are there for the call, and as many as said.
    let _ = unsafe { libc::write(libc::STDERR_FILENO, bytes.as_ptr().cast(), bytes.len()) };
}

/// Returns the id of the calling thread.
pub(crate) fn thread_number() -> i32 {
    // SAFETY: takes nothing, and cannot fail.
    unsafe { libc::gettid() }
}

fn process_number() -> i32 {
    // SAFETY: takes nothing, and cannot fail.
    unsafe { libc::getpid() }
}

/// Returns the name of the calling thread.
pub(crate) fn thread_name(name: &mut [u8; NAME_BYTES]) -> &str {
    // SAFETY: the system writes 16 bytes at most, which are there for the call.
    unsafe { libc::prctl(libc::PR_GET_NAME, name.as_mut_ptr()) };
    let length = name.iter().position(|byte| *byte == 0).unwrap_or(NAME_BYTES);
    std::str::from_utf8(name.get(..length).unwrap_or_default()).unwrap_or_default()
}

/// Name of a signal that ends a process, with its cause.
pub struct SignalName(pub i32);

impl SignalName {
    /// Returns true if the process itself raises this signal, as an invalid memory access or `abort` does.
    #[must_use]
    pub fn is_a_crash(&self) -> bool {
        RAISED.contains(&self.0)
    }
}

impl std::fmt::Display for SignalName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self(signal) = *self;
        match named(signal) {
            Some((name, "")) => write!(f, "signal {signal} ({name})"),
            Some((name, cause)) => write!(f, "signal {signal} ({name}: {cause})"),
            None => write!(f, "signal {signal} (an unhandled signal)"),
        }
    }
}

/// Signals with their names and, where known, causes.
const NAMES: [(c_int, &str, &str); 23] = [
    (SIGSEGV, "SIGSEGV", "invalid memory access, or stack overflow"),
    (SIGBUS, "SIGBUS", "unreadable memory, as of a mapped file that was truncated"),
    (SIGFPE, "SIGFPE", "arithmetic error"),
    (SIGILL, "SIGILL", "illegal instruction"),
    (SIGABRT, "SIGABRT", "abort, as after an uncaught exception"),
    (SIGSYS, "SIGSYS", "forbidden system call"),
    (SIGTRAP, "SIGTRAP", "breakpoint"),
    (SIGKILL, "SIGKILL", "killed by another process, as the out-of-memory killer does"),
    (SIGXCPU, "SIGXCPU", "processor time limit"),
    (SIGXFSZ, "SIGXFSZ", "file size limit"),
    (SIGALRM, "SIGALRM", "a timer"),
    (SIGVTALRM, "SIGVTALRM", "a timer"),
    (SIGPROF, "SIGPROF", "a timer"),
    (SIGINT, "SIGINT", ""),
    (SIGTERM, "SIGTERM", ""),
    (SIGHUP, "SIGHUP", ""),
    (SIGQUIT, "SIGQUIT", ""),
    (SIGTSTP, "SIGTSTP", ""),
    (SIGTTIN, "SIGTTIN", ""),
    (SIGTTOU, "SIGTTOU", ""),
    (SIGUSR1, "SIGUSR1", ""),
    (SIGUSR2, "SIGUSR2", ""),
    (SIGPIPE, "SIGPIPE", ""),
];

/// Returns name and cause of a signal; the cause may be empty.
fn named(signal: c_int) -> Option<(&'static str, &'static str)> {
    NAMES.iter().find(|(known, ..)| *known == signal).map(|(_, name, cause)| (*name, *cause))
}

// ---------------------------------------------------------------- the stack

thread_local! {
    /// Stack for the handlers of this thread.
    static STACK: AlternateStack = AlternateStack::of_this_thread();
}

/// Memory of an alternate stack, on which a handler runs when the thread's own stack is full.
struct AlternateStack {
    memory: *mut [u8],
}

impl AlternateStack {
    fn of_this_thread() -> Self {
        let memory = Box::into_raw(vec![0_u8; STACK_BYTES].into_boxed_slice());
        let stack = libc::stack_t { ss_sp: memory.cast(), ss_flags: 0, ss_size: STACK_BYTES };
        // SAFETY: memory of this length that stays until `drop`, which takes it away from the system first.
        unsafe { libc::sigaltstack(&raw const stack, std::ptr::null_mut()) };
        Self { memory }
    }
}

impl Drop for AlternateStack {
    fn drop(&mut self) {
        let none = libc::stack_t { ss_sp: std::ptr::null_mut(), ss_flags: libc::SS_DISABLE, ss_size: 0 };
        // SAFETY: no handler runs on it, as this thread is here; after this call none will.
        let is_free = unsafe { libc::sigaltstack(&raw const none, std::ptr::null_mut()) } == 0;
        if is_free {
            // SAFETY: made by `Box::into_raw`, and nobody uses it any more.
            drop(unsafe { Box::from_raw(self.memory) });
        }
    }
}

// ---------------------------------------------------------------- signals that stay the host's

/// Blocks signals in the calling thread and in all threads that it starts from now on, so that [`wait_for_signal`] receives the
/// signals. Not real-time.
///
/// # Errors
/// If the system call fails.
pub fn block_signals(signals: &[i32]) -> io::Result<()> {
    let set = set_of(signals);
    // SAFETY: an initialised set, and a null pointer where nothing is to be written.
    match unsafe { libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut()) } {
        0 => Ok(()),
        code => Err(io::Error::from_raw_os_error(code)),
    }
}

/// Waits for one of `signals`, which must be blocked in every thread; returns its number, or `None` after the timeout. Not real-time.
#[must_use]
pub fn wait_for_signal(signals: &[i32], patience: Duration) -> Option<i32> {
    let set = set_of(signals);
    let seconds = libc::time_t::try_from(patience.as_secs()).unwrap_or(libc::time_t::MAX);
    let patience = libc::timespec { tv_sec: seconds, tv_nsec: patience.subsec_nanos().into() };
    // SAFETY: an initialised set and time, and a null pointer where nothing is to be written.
    let signal = unsafe { libc::sigtimedwait(&raw const set, std::ptr::null_mut(), &raw const patience) };
    (signal > 0).then_some(signal)
}

/// Restores the default action of every fatal signal that this process has inherited as ignored (as background jobs of a shell do),
/// except SIGPIPE. For a process that only runs a plugin: a signal that the plugin raises then ends the process. Not real-time.
pub fn ignore_no_signal() {
    let ends = |signal: &c_int| !HARMLESS.contains(signal) && *signal != SIGPIPE; // which Rust programs ignore
    for signal in (1..).take(SIGNALS - 1).filter(ends) {
        let Some(mut found) = action(signal) else { continue };
        if found.sa_sigaction == libc::SIG_IGN {
            found.sa_sigaction = libc::SIG_DFL;
            set_action(signal, &found);
        }
    }
}

/// Starts a process with no signal blocked; it would otherwise inherit the blocked signals of the calling thread. Not real-time.
///
/// # Errors
/// If the system cannot start the process.
pub fn spawn_unblocked(command: &mut Command) -> io::Result<Child> {
    let before = set_blocked(&set_of(&[]));
    let child = command.spawn();
    set_blocked(&before);
    child
}

/// Snapshot of the host's signal actions and of the calling thread's blocked signals, to be restored after a plugin call.
pub struct SignalGuard {
    actions: [Option<sigaction>; KEPT.len()],
    blocked: sigset_t,
}

/// Signals of the host that a plugin has blocked, or whose action a plugin has replaced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TakenSignals {
    bits: u64,
}

impl SignalGuard {
    /// Takes a snapshot of the current actions and blocked signals. Not real-time.
    #[must_use]
    pub fn take() -> Self {
        Self { actions: KEPT.map(action), blocked: blocked() }
    }

    /// Restores actions and blocked signals that have changed since the snapshot; returns the signals with a changed action or
    /// newly blocked. Does nothing in a guest. Not real-time.
    pub fn put_back(&self) -> TakenSignals {
        let mut taken = TakenSignals::default();
        if is_guest() {
            return taken; // the program itself may have changed them
        }
        let blocked = blocked();
        for (signal, before) in KEPT.into_iter().zip(&self.actions) {
            // The handler is ours if another run of this process has begun meanwhile.
            if let (Some(now), Some(before)) = (action(signal), before)
                && now.sa_sigaction != handler()
                && (now.sa_sigaction, now.sa_flags) != (before.sa_sigaction, before.sa_flags)
            {
                set_action(signal, before);
                taken.add(signal);
            }
            if holds(&blocked, signal) && !holds(&self.blocked, signal) {
                taken.add(signal);
            }
        }
        set_blocked(&self.blocked);
        taken
    }
}

impl TakenSignals {
    /// Returns true if the set is empty.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.bits == 0
    }

    /// Encodes the signals, one bit each, for an atomic word.
    #[must_use]
    pub(crate) const fn bits(self) -> u64 {
        self.bits
    }

    /// Decodes the word of [`Self::bits`].
    pub(crate) const fn from_bits(bits: u64) -> Self {
        Self { bits }
    }

    fn add(&mut self, signal: c_int) {
        self.bits |= 1 << (signal - 1);
    }
}

/// Writes the names of the signals, separated by commas.
impl std::fmt::Display for TakenSignals {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let taken = KEPT.into_iter().filter(|signal| self.bits >> (signal - 1) & 1 == 1);
        let names: Vec<&str> = taken.filter_map(named).map(|(name, _)| name).collect();
        f.write_str(&names.join(", "))
    }
}

// ---------------------------------------------------------------- calls of the system

/// Returns the action of a signal; `None` for a signal reserved by the C library.
fn action(signal: c_int) -> Option<sigaction> {
    let mut found = MaybeUninit::<sigaction>::zeroed();
    // SAFETY: nothing is changed, and the system writes to memory that is there for the call.
    let code = unsafe { libc::sigaction(signal, std::ptr::null(), found.as_mut_ptr()) };
    // SAFETY: plain data, all of whose bits may be zero, and written if the call went well.
    (code == 0).then(|| unsafe { found.assume_init() })
}

/// Sets the action of a signal: one that the system returned, or the handler of this module.
fn set_action(signal: c_int, action: &sigaction) {
    // SAFETY: an initialised action whose handler, if any, was there before, is `on_signal`, which may run at any time, or is the
    // system's default.
    let _ = unsafe { libc::sigaction(signal, action, std::ptr::null_mut()) };
}

/// Returns the set of `signals`.
#[must_use]
pub fn set_of(signals: &[i32]) -> sigset_t {
    let mut set = MaybeUninit::<sigset_t>::zeroed();
    // SAFETY: memory that is there for the call, which initialises it; plain data.
    let mut set = unsafe {
        libc::sigemptyset(set.as_mut_ptr());
        set.assume_init()
    };
    for signal in signals {
        // SAFETY: an initialised set.
        unsafe { libc::sigaddset(&raw mut set, *signal) };
    }
    set
}

/// Returns the set of all signals except `signals`.
#[must_use]
pub fn all_but(signals: &[i32]) -> sigset_t {
    let mut set = set_of(&[]);
    // SAFETY: an initialised set, here and below.
    unsafe { libc::sigfillset(&raw mut set) };
    for signal in signals {
        // SAFETY: as above.
        unsafe { libc::sigdelset(&raw mut set, *signal) };
    }
    set
}

/// Replaces the set of blocked signals of the calling thread; returns the previous set. Not real-time.
pub fn set_blocked(set: &sigset_t) -> sigset_t {
    let mut before = set_of(&[]);
    // SAFETY: initialised sets that are there for the call.
    unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, set, &raw mut before) };
    before
}

fn unblock(signals: &[c_int]) {
    let set = set_of(signals);
    // SAFETY: an initialised set, and a null pointer where nothing is to be written.
    unsafe { libc::pthread_sigmask(libc::SIG_UNBLOCK, &raw const set, std::ptr::null_mut()) };
}

fn blocked() -> sigset_t {
    let mut set = set_of(&[]);
    // SAFETY: nothing is changed, and the system writes to memory that is there for the call.
    unsafe { libc::pthread_sigmask(libc::SIG_BLOCK, std::ptr::null(), &raw mut set) };
    set
}

fn holds(set: &sigset_t, signal: c_int) -> bool {
    // SAFETY: an initialised set.
    unsafe { libc::sigismember(set, signal) == 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_that_were_taken_away_are_put_back_and_named() {
        std::thread::spawn(|| {
            let kept = SignalGuard::take();
            assert_eq!(kept.put_back(), TakenSignals::default());
            block_signals(&[libc::SIGQUIT, libc::SIGCHLD]).expect("they can be blocked");
            let taken = kept.put_back();
            assert_eq!(taken.to_string(), "SIGQUIT");
            assert!(!holds(&blocked(), libc::SIGQUIT) && !holds(&blocked(), libc::SIGCHLD));
            assert_eq!(TakenSignals::from_bits(taken.bits()), taken);
        })
        .join()
        .expect("it holds");
    }
}
