# Sourced: a Debian in the folder $root with the toolchain that Debian ships for its browsers, the library's sources, MinGW-w64 and Wine,
# and a copy of this repository in it. `lacking` prints what the machine lacks for it, if anything; `make_root` makes it, or brings it up
# to date; then `inside COMMAND` carries a command out there, in that copy, and `cargo` builds for Windows.
#
# Needs root's rights, debootstrap, the network and 4 GB of room.

packages="rustc-web cargo-web rust-web-src rust-web-clippy gcc-mingw-w64-x86-64-win32 wine64"
# Wine 8 has no ProcessPrng, which the standard library asks for random numbers.
stub='#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG count);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) { return SystemFunction036(bytes, (ULONG)count); }'
# The file `installed` in the folder says that it is such a Debian: with $begun, one that is not whole; with $recipe, one that has all.
begun="flotor: begun"
recipe="bookworm: $packages
$stub"

lacking() {
    if [ "$(id -u)" != 0 ]; then echo "only root can make a Debian for Windows' toolchain"; return; fi
    command -v debootstrap > /dev/null && return
    { apt-get -qq update && apt-get -qq install -y --no-install-recommends debootstrap debian-archive-keyring; } > /dev/null || true
    command -v debootstrap > /dev/null || echo "debootstrap is not installed"
}

make_root() {
    if [ ! -e "$root/installed" ] && [ -e "$root" ] && [ -n "$(ls -A "$root")" ]; then
        echo "$root is not empty and no Debian of .ci/windows (it has no file \`installed\`); name another folder, or empty it" >&2
        exit 1
    fi
    if [ ! -e "$root/installed" ] || [ "$(cat "$root/installed")" = "$begun" ]; then
        rm -rf "$root"
        mkdir -p "$root"
        echo "$begun" > "$root/installed"
        debootstrap --variant=minbase --include=ca-certificates bookworm "$root" > /dev/null
        for suite in "debian bookworm-updates" "debian-security bookworm-security"; do
            echo "deb http://deb.debian.org/${suite% *} ${suite#* } main" >> "$root/etc/apt/sources.list"
        done
        echo "has its base" > "$root/installed"
    fi
    if [ "$(cat "$root/installed")" != "$recipe" ]; then
        cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
        chroot "$root" apt-get -qq update
        # shellcheck disable=SC2086 # a list
        chroot "$root" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends $packages > /dev/null
        echo "$stub" > "$root/stub.c"
        chroot "$root" x86_64-w64-mingw32-gcc-win32 -shared -o /bcryptprimitives.dll /stub.c -ladvapi32
        echo "$recipe" > "$root/installed"
    fi
    bring_sources
}

# This repository as it is now, and what the programs need beside them.
bring_sources() {
    cp -L /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
    rm -rf "$root/flotor"
    mkdir -p "$root/flotor" "$root/built/x86_64-pc-windows-gnu/debug/deps"
    # What is under version control, as it is now.
    git ls-files -z --cached --others --exclude-standard | tar --null -cT - | tar -xC "$root/flotor"
    rm "$root/flotor/rust-toolchain.toml"
    for beside in . deps examples; do
        mkdir -p "$root/built/x86_64-pc-windows-gnu/debug/$beside"
        cp "$root/bcryptprimitives.dll" "$root/built/x86_64-pc-windows-gnu/debug/$beside/"
    done
}

# A command in that Debian. Its linker writes a time into each program and library: one for all, so that the same sources give the
# same bytes.
inside() {
    unshare --mount bash -euc '
        mount --make-rprivate /
        mount -t proc proc "$0/proc"
        mount --rbind /dev "$0/dev"
        exec chroot "$0" /usr/bin/env -i HOME=/root LANG=C.UTF-8 TERM=dumb PATH=/usr/sbin:/usr/bin:/sbin:/bin ${http_proxy:+http_proxy="$http_proxy"} \
            ${https_proxy:+https_proxy="$https_proxy"} CARGO_HTTP_CAINFO=/etc/ssl/certs/ca-certificates.crt RUSTC_BOOTSTRAP=1 \
            SOURCE_DATE_EPOCH=315532800 \
            CARGO_TARGET_DIR=/built CARGO_BUILD_TARGET=x86_64-pc-windows-gnu CARGO_UNSTABLE_BUILD_STD=std,panic_unwind \
            CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc-win32 \
            CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER=/usr/lib/wine/wine64 WINEDEBUG=-all WINEPREFIX=/wine \
            sh -euc "cd /flotor && $1"' "$root" "$1"
}
