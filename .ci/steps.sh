# Sourced by `run` and `full`: how a step is run and reported, and the steps every change must pass.
# Stops at the first step that fails. Needs a Rust toolchain with rustfmt and clippy, and a C compiler.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

report=()

# step NAME COMMAND...: says what runs, runs it, says how long it took.
step() {
    local name=$1 started=$SECONDS code
    shift
    printf '\n[%s] %s\n' "$name" "$*"
    # Not as a condition: within one, `set -e` is ignored, and a function of many commands is what its last one says.
    set +e
    (set -e; "$@")
    code=$?
    set -e
    if [ "$code" = 0 ]; then
        report+=("$(printf '%-8s ok %6d s' "$name" $((SECONDS - started)))")
    else
        report+=("$(printf '%-8s FAILED after %d s (exit code %d): %s' "$name" $((SECONDS - started)) "$code" "$*")")
        summary
        exit "$code"
    fi
}

# Prints what ran so far, a line a step.
summary() {
    printf '\n'
    printf '%s\n' "${report[@]}"
}

# What the tests use beyond Rust and a C compiler, by Debian's names: valgrind counts instructions, Xvfb and xdotool hold
# and push a real window, drawn by Mesa; QEMU emulates other processors, and with busybox and cpio a small virtual machine.
debian_packages="g++ python3 valgrind xvfb xdotool libegl1 libgl1-mesa-dri libxkbcommon-x11-0 qemu-user qemu-system-x86 busybox-static cpio"

# What the tests use has to be here: where a tool is missing they fail instead of being skipped.
export FLOTOR_REQUIRE=${FLOTOR_REQUIRE-cc,cxx,valgrind,display,qemu,python}

# Installs what is missing where that is possible.
machine() {
    local missing
    # shellcheck disable=SC2086 # a list of packages
    missing=$(dpkg-query -Wf '${db:Status-Status} ${Package}\n' $debian_packages 2>/dev/null | sed -n 's/^installed //p' |
        grep -vxFf - <(printf '%s\n' $debian_packages) || true)
    [ -n "$missing" ] || return 0
    if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
        echo "not installed, and only root on Debian can change that here:" $missing
        return 0
    fi
    # shellcheck disable=SC2086
    apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $missing >/dev/null
}

# The checks of every change, cheapest first.
every_change() {
    step machine machine
    step format cargo fmt --all --check
    # The README's `cargo test`, and the viewer, whose GPU stack that leaves out. One command: of two, the second builds half of
    # what both use again, with other features.
    step test cargo test --workspace --features flotor-tests/formats --no-fail-fast
    # Counts of instructions of the optimised program against their budgets.
    step budgets cargo test --release -p flotor-tests --test instructions
    step lint cargo clippy --workspace --all-targets -- -D warnings
    step docs env RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps
    # Workspaces of their own: that they still compile against the host.
    step beside cargo check --manifest-path host/python/Cargo.toml --target-dir target
    step size .ci/lines
    # Plugins against the USB, HID and serial drivers of a kernel; skips, and says why, without QEMU.
    step usb .ci/vm
    # Every interleaving of the lock-free cells. A target folder of its own: the flag changes every crate.
    step loom env RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
}

# The machine this runs on, as Rust calls it: with a target of its own, build scripts stay without sanitizers.
target() {
    rustc -vV | sed -n 's/^host: //p'
}

# Data races by ThreadSanitizer: threads on the lock-free cells. The standard library is built along, for its locks and
# threads to be seen too; that takes its sources. Loom finds what depends on memory orders, this what is not atomic at all.
race() {
    rustup component add rust-src
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=thread" cargo test -Zbuild-std --target "$(target)" --target-dir target/tsan \
        -p flotor-sync --lib
}

# Whatever a tick does that may block, by RealtimeSanitizer: memory, files, locks, also inside plugins. It ends the process
# with the place. The plugins are ordinary ones: the sanitizer is in the program, which has to be the only one with it. The
# model that starts a thread in a step has to be caught: else nothing was watched.
blocking() {
    local flotor
    local -x FLOTOR_PLUGIN_PATH=target/debug/deps
    flotor=target/rtsan/$(target)/debug/flotor
    cargo build -p flotor -p fixture-faulty-model
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=realtime --cfg rtsan" cargo build --target "$(target)" --target-dir target/rtsan \
        -p flotor --bin flotor
    "$flotor" run --clock virtual --duration 5s --seed 1
    "$flotor" run --clock real --duration 2s --seed 1
    "$flotor" run --clock virtual --duration 5s --set device.preset=full
    "$flotor" run --clock virtual host/scenes/teleoperation.toml
    "$flotor" run --clock virtual host/scenes/balls.toml
    printf '%s\n' '[device]' 'plugin = "simulated"' '[[model]]' 'plugin = "fixture-faulty-model"' '[model.parameters]' \
        'fault = "starts-threads"' > target/rtsan/blocks.toml
    if "$flotor" run --clock virtual --duration 1s target/rtsan/blocks.toml; then
        echo "a model that starts threads in a step was not noticed"
        return 1
    fi
}

# One set of bits: the golden digests, optimised, on the processor at hand and on emulated ones with AVX2 and without AVX.
bits() {
    local runner
    for runner in "" "qemu-x86_64 -cpu Haswell" "qemu-x86_64 -cpu qemu64"; do
        if ! command -v "${runner%% *}" >/dev/null && [ -n "$runner" ]; then
            echo "skipped: there is no ${runner%% *} to emulate processors with"
            return 0
        fi
        echo "on ${runner:-the processor at hand}:"
        FLOTOR_RUNNER=$runner cargo test --release -p flotor-tests golden -- --nocapture
    done
}

# The Python wheel as a user installs it, and its tests against the command: models, runs, sweeps on threads and Dask; and the
# Python of the book, with the package that it names for recordings.
wheel() {
    python3 -m venv target/venv
    target/venv/bin/pip install --quiet 'host/python[test]' mcap-protobuf-support
    cargo build --release
    cargo build --release --manifest-path host/sweep/Cargo.toml --target-dir target/sweep
    FLOTOR=target/release/flotor FLOTOR_SWEEP=target/sweep/release/flotor-sweep target/venv/bin/python -m pytest -q host/python
    FLOTOR_TEST_SIZE=full FLOTOR_PYTHON=$PWD/target/venv/bin/python cargo test --release -p flotor-tests --test system book::
}

# The bridge: messages to the bit, who may do what, what is refused, over loopback; two hosts with a hand each over a bad way.
# Full size is a minute at 1 kHz, and every hand.
bridge() {
    cargo build --release
    FLOTOR=target/release/flotor FLOTOR_TEST_SIZE=full \
        cargo test --release --manifest-path host/bridge/Cargo.toml --target-dir target/bridge
    cargo clippy --release --all-targets --manifest-path host/bridge/Cargo.toml --target-dir target/bridge -- -D warnings
}
