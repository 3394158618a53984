# Sourced by `run` and `full`: how a step is run and reported, and the steps every change must pass.
# Stops at the first step that fails. Needs a Rust toolchain with rustfmt and clippy, and a C compiler.

set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

report=()
left_out=()
logs=target/ci
mkdir -p "$logs"

# Names of the steps to run, from the command line; all steps where there are none.
wanted=("$@")

# step NAME COMMAND...: prints the command, runs it and prints its duration. Its output goes to target/ci/NAME.log, too.
step() {
    local name=$1 started=$SECONDS code log=$logs/$1.log
    shift
    if [ ${#wanted[@]} -gt 0 ] && [[ " ${wanted[*]} " != *" $name "* ]]; then
        left_out+=("$name: this step was not asked for")
        return
    fi
    printf '\n[%s] %s\n' "$name" "$*"
    # Not as a condition: within one, `set -e` is ignored, and a function of many commands is what its last one says.
    set +e
    (set -e; "$@") 2>&1 | tee "$log"
    code=${PIPESTATUS[0]}
    set -e
    # Tests that are ignored, with the reason the test gives, and tools that say they skip something.
    while IFS= read -r line; do left_out+=("$name: $line"); done < <(
        sed -n -e 's/^test \(.* \.\.\. ignored.*\)/\1/p' -e 's/^\(skipped: .*\)/\1/pI' "$log" | sort -u)
    if [ "$code" = 0 ]; then
        report+=("$(printf '%-10s ok %6d s' "$name" $((SECONDS - started)))")
    else
        report+=("$(printf '%-10s FAILED after %d s (exit code %d): %s' "$name" $((SECONDS - started)) "$code" "$*")")
        summary
        # The place and the first words of every failed test: of a long log, often the end alone is kept.
        { grep -aA 3 ' panicked at ' "$log" || true; } | cut -c 1-400 | tail -n 60
        exit "$code"
    fi
}

# Prints what ran so far, a line a step, and what was left out of it; fails without a single step.
summary() {
    [ ${#report[@]} -gt 0 ] || { echo "no step is called: ${wanted[*]}"; return 1; }
    printf '\n'
    printf '%s\n' "${report[@]}"
    printf 'in all %11d s\n' "$SECONDS"
    printf '\nleft out:\n'
    if [ ${#left_out[@]} = 0 ]; then echo '  nothing'; else printf '  %s\n' "${left_out[@]}"; fi
}

# What the tests use beyond Rust, each program with Debian's package: valgrind counts instructions, Xvfb and xdotool hold and push a
# real window, drawn by Mesa; QEMU emulates other processors, and with busybox and cpio a small virtual machine.
tools="cc:gcc c++:g++ valgrind:valgrind Xvfb:xvfb xdotool:xdotool qemu-x86_64:qemu-user qemu-system-x86_64:qemu-system-x86
    busybox:busybox-static cpio:cpio python3:python3"
libraries="libegl1 libgl1-mesa-dri libxkbcommon-x11-0"

# What the tests use has to be here: where a tool is missing they fail instead of being skipped.
export FLOTOR_REQUIRE=${FLOTOR_REQUIRE-cc,cxx,valgrind,display,qemu,python,rustfmt}

# Without a size, tests that take longer than others are skipped, as in a newcomer's `cargo test`.
export FLOTOR_TEST_SIZE=${FLOTOR_TEST_SIZE-daily}

# What is not here, by package.
missing_packages() {
    local tool
    for tool in $tools; do command -v "${tool%%:*}" >/dev/null || echo "${tool##*:}"; done
    # shellcheck disable=SC2086 # a list of packages
    { dpkg-query -Wf '${db:Status-Status} ${Package}\n' $libraries 2>/dev/null || true; } | sed -n 's/^installed //p' |
        grep -vxFf - <(printf '%s\n' $libraries) || true
}

# Installs what is missing; names and fails on what is still missing then.
machine() {
    local missing
    missing=$(missing_packages)
    if [ -n "$missing" ] && command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
        # shellcheck disable=SC2086
        apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $missing >/dev/null || true
    fi
    missing=$(missing_packages)
    [ -z "$missing" ] && return 0
    echo "missing, by Debian's packages:" $missing
    return 1
}

# That `machine` fails and names the package where a tool or a library is missing: each is hidden in turn, and so is apt-get.
missing_named() {
    local programs=$PWD/target/ci/programs folder entry package said
    rm -rf "$programs"
    mkdir -p "$programs"
    # Of two programs with one name the first is kept, as in PATH.
    for folder in ${PATH//:/ }; do ln -s "$folder"/* "$programs" 2>/dev/null || true; done
    rm -f "$programs/apt-get"
    for entry in $tools $libraries; do
        package=${entry##*:}
        if said=$(
            [ "$entry" = "$package" ] || mv "$programs/${entry%%:*}" "$programs/.hidden"
            dpkg-query() { command dpkg-query "$@" | sed "/ $package\$/d"; }
            PATH=$programs
            hash -r
            machine
        ); then
            echo "without $entry nothing is said to be missing"
            return 1
        fi
        [ -e "$programs/.hidden" ] && mv "$programs/.hidden" "$programs/${entry%%:*}"
        grep -qw -- "$package" <<<"$said" || { echo "without $entry: $said"; return 1; }
        echo "without ${entry%%:*}: $said"
    done
}

# Workspaces of their own beside the core.
satellites="interop/python interop/bridge interop/sweep tests/fuzz"

format() {
    local satellite
    cargo fmt --all --check
    for satellite in $satellites; do cargo fmt --manifest-path "$satellite/Cargo.toml" --check; done
    cargo fmt --all --manifest-path examples/Cargo.toml --check
}

# The checks of every change that build nothing.
before_tests() {
    step machine machine
    step format format
    step size .ci/lines
    step circles .ci/circles
    step deny deny
}

# The checks of every change that build, after the tests, whose libraries they use.
after_tests() {
    step lint lint
    # With the features and examples of `lint`: else what wgpu and serde depend on is checked a second time, with fewer features.
    # The named program is the only one without a library beside it.
    step docs env RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --all-features --lib --examples \
        --bin flotor-haply-service-emulator
    # Counts of instructions of the optimised program against their budgets.
    step budgets cargo test --release -p flotor-instructions --features budgets
    # Every interleaving of the lock-free cell. A target folder of its own: the flag changes every crate. The crate forbids
    # `unsafe`, so that data races are left to the compiler.
    step loom env RUSTFLAGS="--cfg loom" cargo test -p flotor-sync --release --test loom --target-dir target/loom
}

# Clippy of the core, the examples and the fuzzing targets. The other satellites' is in the steps that build them.
lint() {
    cargo clippy --workspace --all-targets --all-features -- -D warnings
    cargo clippy --manifest-path examples/Cargo.toml --target-dir target --workspace --all-targets -- -D warnings
    cargo clippy --manifest-path tests/fuzz/Cargo.toml --target-dir target --all-targets -- -D warnings
}

# The machine this runs on, as Rust calls it: with a target of its own, build scripts stay without sanitizers.
target() {
    rustc -vV | sed -n 's/^host: //p'
}

# Whatever a tick does that may block, by RealtimeSanitizer: memory, files, locks, also inside plugins. It ends the process
# with the place. The plugins are ordinary ones: the sanitizer is in the program, which has to be the only one with it; so is
# the standard library, whose sources need not be here. The model that starts a thread in a step has to be caught: else nothing
# was watched.
blocking() {
    local flotor
    local -x FLOTOR_PLUGIN_PATH=target/debug/deps
    flotor=target/rtsan/$(target)/debug/flotor
    cargo build
    cargo build -p fixture-faulty-model
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=realtime -Cunsafe-allow-abi-mismatch=sanitizer --cfg rtsan" \
        cargo build --target "$(target)" --target-dir target/rtsan -p flotor --bin flotor
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
    cargo build --release
    for runner in "" "qemu-x86_64 -cpu Haswell" "qemu-x86_64 -cpu qemu64"; do
        echo "on ${runner:-the processor at hand}:"
        FLOTOR_RUNNER=$runner cargo test --release -p flotor-tests --test system golden -- --nocapture
    done
}

# Coverage-guided fuzzing of what reads bytes that others wrote, a minute each, and ten for each of the four formats of meshes. The instrumentation is LLVM's, as `cargo fuzz` asks
# for it; without its address sanitizer no nightly compiler is needed, and the decoders have no `unsafe`.
fuzz() {
    local reader seconds coverage="--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
        -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
        -Cllvm-args=-sanitizer-coverage-trace-compares"
    for reader in decode ml_api gmsh mesh; do
        seconds=60
        [ $reader != mesh ] || seconds=2400
        # What it starts from, and what it finds on the way.
        mkdir -p "target/fuzz/found/$reader"
        find "tests/fuzz/seeds/$reader" -type f -exec cp {} "target/fuzz/found/$reader" \; 2>/dev/null || true
        RUSTFLAGS="$(echo $coverage)" cargo run --release --manifest-path tests/fuzz/Cargo.toml \
            --target "$(target)" --target-dir target/fuzz --bin "$reader" -- \
            "target/fuzz/found/$reader" -max_total_time=$seconds -print_final_stats=1
    done
}

# Advisories, licences and sources of all workspaces by deny.toml. The daily tests compare licences and sources without it; it
# needs the network, for the advisories, and `cargo install cargo-deny --locked`.
deny() {
    local workspace
    if ! command -v cargo-deny >/dev/null; then
        echo "skipped: cargo-deny is not installed"
        return 0
    fi
    for workspace in . interop/python interop/bridge interop/sweep; do
        cargo deny --manifest-path "$workspace/Cargo.toml" check --config deny.toml advisories licenses sources
    done
}

# The Python wheel as a user installs it, and its tests against the command: models, runs, sweeps on threads and Dask; and the
# Python of the book, with the package that it names for recordings.
wheel() {
    cargo clippy --manifest-path interop/python/Cargo.toml --target-dir target --all-targets -- -D warnings
    python3 -m venv target/venv
    CARGO_TARGET_DIR=$PWD/target target/venv/bin/pip install --quiet 'interop/python[test]' mcap-protobuf-support mujoco
    cargo build --release
    cargo build --release --manifest-path interop/sweep/Cargo.toml --target-dir target/sweep
    FLOTOR=target/release/flotor FLOTOR_SWEEP=target/sweep/release/flotor-sweep target/venv/bin/python -m pytest -q interop/python
    # Whatever array is passed, no call of ours reads or writes beside it; CPython and the loader have findings of their own.
    PYTHONMALLOC=malloc valgrind --error-limit=no --num-callers=40 --log-file=target/wheel-memory.log target/venv/bin/python -m pytest \
        -q -p no:cacheprovider interop/python/tests/test_model.py -k "whatever_lies or share_memory or not_aligned"
    if grep "_flotor\|libflotor" target/wheel-memory.log; then return 1; fi
    FLOTOR_TEST_SIZE=daily FLOTOR_PYTHON=$PWD/target/venv/bin/python cargo test --release -p flotor-tests --test system -- book:: examples::
    PATH=$PWD/target/venv/bin:$PATH FLOTOR_PYTHON=$PWD/target/venv/bin/python book_blocks wheel
}

# Flotor's devices as teleoperators of LeRobot as it comes from the package index, in an environment of its own: ten minutes through a wall.
lerobot() {
    python3.12 -m venv target/lerobot
    CARGO_TARGET_DIR=$PWD/target target/lerobot/bin/pip install --quiet interop/python interop/lerobot pytest
    PATH=$PWD/target/lerobot/bin:$PATH book_blocks lerobot
}

# book_blocks STEP [COMMAND...]: runs the blocks of the book that are marked with this step, in the chapters that have them; with a
# command that starts another one, through it.
book_blocks() {
    local step=$1
    shift
    FLOTOR_BOOK_STEP=$step FLOTOR_TEST_SIZE=daily "$@" cargo test --release -p flotor-tests --test system -- --nocapture \
        book::every_block_of_the_book_does_what_the_book_says
}

# The blocks of the book that need Gmsh, the profiler, or an installation.
book() {
    cargo build --release
    book_blocks book
}

# The blocks of the book in which host and emulated device keep the time of the machine's clock: with real-time priority.
real() {
    cargo build --release
    cargo build --release -p flotor-haply --example emulated_board
    book_blocks real chrt -f 10
}

# Programs of other makers' interfaces, as they are published: each drives the simulated flotor for a minute at its own pace.
programs() {
    cargo build --release -p flotor -p flotor-lend -p flotor-simulated -p flotor-dhd -p flotor-openhaptics -p flotor-chai3d \
        -p flotor-haply-service
    python3 -m venv target/programs
    target/programs/bin/pip install --quiet forcedimension-core==1.0.0 pyopenhaptics==1.0.1
    lent dhd target/programs/bin/python tests/programs/dhd.py 60
    lent openhaptics target/programs/bin/python tests/programs/openhaptics.py 60
    cc -std=c11 -Wall -Wextra -Werror -O2 -o target/programs/phantom tests/c/programs/phantom.c -ldl -lm -lpthread
    target/release/flotor lend --api chai3d -- target/programs/phantom plain 60000
    lent haply python3 tests/programs/haply.py 60
    haply_examples
    target/release/flotor lend --api haply -- tests/programs/haply.sh target/programs/haply/target/debug/examples
}

# lent API PROGRAM...: runs a program on the simulated flotor. It must loop at the tick rate of the same run, to half a percent.
lent() {
    local api=$1 said=target/programs/said summary=target/programs/summary.json
    shift
    rm -f "$said" "$summary"
    target/release/flotor lend --api "$api" --json "$summary" -- "$@" | tee "$said"
    python3 -c 'import json, re, sys
said, summary = open(sys.argv[1]).read(), json.load(open(sys.argv[2]))
own_hz, loop_hz = float(re.search(r"ok: ([\d.]+)", said)[1]), summary["ticks"] / summary["wall_s"]
print(f"{own_hz:.1f} a second, of {loop_hz:.1f} ticks")
assert own_hz >= 0.995 * loop_hz
# A machine that takes the processor away costs a few periods in a hundred; a library that blocks the loop costs more.
assert loop_hz >= 0.9 * summary["rate_hz"]' "$said" "$summary"
}

# The examples of Haply's crate, whose sources cargo fetches as those of a dependency.
haply_examples() {
    local asking=target/programs/haply-source source
    mkdir -p "$asking/src"
    touch "$asking/src/lib.rs"
    printf '%s\n' '[workspace]' '[package]' 'name = "haply-source"' 'edition = "2024"' '[dependencies]' 'haply = "=1.3.1"' \
        > "$asking/Cargo.toml"
    source=$(cargo metadata --format-version 1 --manifest-path "$asking/Cargo.toml" | python3 -c 'import json, os, sys
print(*(os.path.dirname(package["manifest_path"]) for package in json.load(sys.stdin)["packages"] if package["name"] == "haply"))')
    rm -rf target/programs/haply
    cp -r "$source" target/programs/haply
    printf '\n[workspace]\n' >> target/programs/haply/Cargo.toml
    (cd target/programs/haply && cargo build --examples)
}

# The sweeper: a table of every kind.
sweep() {
    cargo build --release
    FLOTOR=$PWD/target/release/flotor cargo test --release --manifest-path interop/sweep/Cargo.toml --target-dir target/sweep
    cargo clippy --release --all-targets --manifest-path interop/sweep/Cargo.toml --target-dir target/sweep -- -D warnings
}

# The bridge: messages to the bit, who may do what, what is refused, over loopback; two hosts with a hand each over a bad way.
# Full size is a minute at 1 kHz, and every hand.
bridge() {
    cargo build --release
    FLOTOR=target/release/flotor FLOTOR_TEST_SIZE=full \
        cargo test --release --manifest-path interop/bridge/Cargo.toml --target-dir target/bridge
    cargo clippy --release --all-targets --manifest-path interop/bridge/Cargo.toml --target-dir target/bridge -- -D warnings
}

# Every kind of picture that a command draws, and those of the book, by four renderers. The sheets show them side by side.
pictures() {
    local folder=target/ci/pictures
    rm -rf "$folder"
    mkdir -p "$folder"
    cargo build --release
    cargo build --release -p flotor-viewer
    PATH=$PWD/target/release:$PWD/target/sweep/release:$PATH FLOTOR_PLUGIN_PATH=$PWD/target/release tests/pictures/make "$folder/made"
    /usr/bin/python3 tests/pictures/draw.py "$folder/made" "$folder/sheets"
    book_blocks pictures
}

# The archive of a release, unpacked into an empty folder: the demo and the scenes of the repository, and a picture by the viewer,
# without a network; on this machine, and on a Debian with nothing but its base system, where nothing may be written outside that
# folder. The wheel, in a Python of its own: the demo, with the plugins that it contains.
archive() {
    local trial=target/ci/archive bare=target/ci/bare made
    rm -rf "$trial"
    cargo build --release --locked -p flotor-viewer
    mapfile -t made < <(.ci/archive)
    .ci/archive.d/trial "${made[0]}" "$trial"
    if has_bare_root; then
        .ci/bare-root "$bare" 'rm -rf /tmp/trial'
        find "$bare" -xdev | sort > target/ci/before
        .ci/bare-root "$bare" "/given/archive.d/trial /given/${made[0]##*/} /tmp/trial" .ci/archive.d "${made[0]}"
        find "$bare" -xdev -not -path "$bare/tmp/trial*" -not -path "$bare/given*" | sort | diff target/ci/before -
    fi
    [ ${#made[@]} -gt 1 ] || return 0
    python3 -m venv --clear target/ci/installed
    target/ci/installed/bin/pip install --quiet "${made[1]}"
    (cd target/ci && env -u FLOTOR_PLUGIN_PATH installed/bin/python -c 'import flotor; print(flotor.run(duration_s=1)["peak_force_n"], "N")')
}

# The commands of the book for a newcomer, from a clone to a passing test, and to failing ones after four mistakes: on a bare Debian
# with Rust and a C compiler. What this clone has fetched from the registry is all that there is: there is no network.
newcomer() {
    local root=target/ci/newcomer here
    here=/given/$(basename "$PWD")
    has_bare_root || return 0
    cargo fetch --locked
    PACKAGES=gcc,libc6-dev,git,ca-certificates RUST=1 .ci/bare-root "$root" "rm -rf /tmp/newcomer
        git config --global --replace-all safe.directory '*'
        FLOTOR_REPOSITORY=$here $here/tests/newcomer /tmp/newcomer" .
    rm -rf "$root/tmp/newcomer"
}

# The workflows of `flotor new` and of the examples, unchanged, from the archive that the step before has made: on a bare Debian with
# Rust, a C compiler and curl.
workflow() {
    local root=target/ci/workflow archive
    has_bare_root || return 0
    archive=$(ls -t target/archive/flotor-*-linux.tar.gz | head -n 1)
    PACKAGES=gcc,libc6-dev,curl,ca-certificates RUST=1 .ci/bare-root "$root" "
        rm -rf /tmp/forge && mkdir -p /tmp/forge/bin && cd /tmp/forge
        export FLOTOR_ARCHIVE=file:///given/${archive##*/}
        tar -xzf /given/${archive##*/} --strip-components 1 -C bin && flotor=\$PWD/bin/bin/flotor
        mkdir repositories && cd repositories
        \$flotor new model jelly && \$flotor new model honey --language c && \$flotor new device knob
        cp -r /given/ci ci
        for workflow in jelly/.github/workflows/haptics.yml honey/.github/workflows/haptics.yml knob/.github/workflows/haptics.yml \
            ci/workflow.yml ci/device.yml; do
            rm -rf \${workflow%%/*}/.cargo \${workflow%%/*}/flotor # as a checkout has it
            echo \"[\$workflow]\"
            (cd \${workflow%%/*} && /given/workflow \${workflow#*/})
        done" tests/workflow examples/ci "$archive"
    rm -rf "$root/tmp/forge"
}

# True if a bare Debian can be made here.
has_bare_root() {
    if [ "$(id -u)" != 0 ]; then
        echo "skipped: only root can make a bare Debian"
        return 1
    fi
    command -v debootstrap > /dev/null || apt-get -qq install -y --no-install-recommends debootstrap > /dev/null || true
    command -v debootstrap > /dev/null || { echo "skipped: debootstrap is not installed"; return 1; }
}

# Every crate that is meant to be published compiles from its package alone. Needs the network, for the registry's index.
packages() {
    # What an earlier dry run has unpacked and built of these crates has the same version, and would be taken for them. The registry of
    # a dry run has no host, and so a folder whose name begins with a dash and its hash.
    rm -rf target/packages "${CARGO_HOME:-$HOME/.cargo}"/registry/{src,cache}/-*/flotor-*
    cargo publish --workspace --dry-run --locked --target-dir target/packages
}
