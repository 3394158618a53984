#!/usr/bin/env bash
# The examples of Haply's own crate, as they are: each for some seconds, by what it prints.
# `flotor lend --api haply -- tests/programs/haply.sh FOLDER`, the folder with the built examples.
set -euo pipefail
folder=$1

# expect TEXT EXAMPLE ARGUMENTS: most of them go on until somebody ends them.
expect() {
    local text=$1 said
    shift
    said=$(timeout 4 "$folder/$@" 2>&1 | tr '\r' '\n' || true)
    grep -q -- "$text" <<<"$said" || { printf '%s: no "%s" in\n%s\n' "$*" "$text" "$said"; exit 1; }
    echo "ok: $*"
}

expect 'Found 2 connected device' device_basics
expect 'Found 2 connected device' device_basics --http-only
expect '1 Inverse3, 0 VG, 1 WVG' device_basics --stream
expect '1 Inverse3, 0 VG, 1 WVG' device_basics --stream --probe F001
expect '\[F001\] Pos: (0.0000, -0.1200, 0.1[45]' device_basics --zero-force
expect 'WS confirmed profile: test_profile' profile_demo
expect 'i3:F001, wvg:A001' ping_demo
expect 'Force: (-\?[0-9.]*,-[1-9]' haptic_sample
expect 'Rendered Force: ([1-9]' go_to_position_demo
expect 'Ori: (' damping_demo
POLL_RATE=1 expect 'DeviceConnected' events_demo
