# Sourced: a Debian in the folder $root with the toolchain that Debian ships for its browsers, the library's sources, MinGW-w64 and Wine,
# and a copy of this repository in it. `inside COMMAND` carries a command out there, in that copy; `cargo` builds for Windows then.
#
# Needs root's rights, debootstrap, the network and 4 GB of room.

mkdir -p target/ci
if [ "$(id -u)" != 0 ]; then echo "skipped: only root can make a Debian for Windows' toolchain"; exit 0; fi
command -v debootstrap > /dev/null || { apt-get -qq update && apt-get -qq install -y --no-install-recommends debootstrap debian-archive-keyring > /dev/null; } || true
command -v debootstrap > /dev/null || { echo "skipped: debootstrap is not installed"; exit 0; }
if [ ! -e "$root/installed" ]; then
    rm -rf "$root"
    debootstrap --variant=minbase --include=ca-certificates bookworm "$root" > /dev/null
    for suite in "debian bookworm-updates" "debian-security bookworm-security"; do
        echo "deb http://deb.debian.org/${suite% *} ${suite#* } main" >> "$root/etc/apt/sources.list"
    done
    cp -L /etc/resolv.conf /etc/hosts "$root/etc/"
    chroot "$root" apt-get -qq update
    chroot "$root" env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends \
        rustc-web cargo-web rust-web-src rust-web-clippy gcc-mingw-w64-x86-64-win32 wine64 > /dev/null
    # Wine 8 has no ProcessPrng, which the standard library asks for random numbers.
    cat > "$root/stub.c" <<'STUB'
#include <windows.h>
BOOLEAN NTAPI SystemFunction036(PVOID bytes, ULONG count);
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) { return SystemFunction036(bytes, (ULONG)count); }
STUB
    chroot "$root" x86_64-w64-mingw32-gcc-win32 -shared -o /bcryptprimitives.dll /stub.c -ladvapi32
    touch "$root/installed"
fi
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

# A command in that Debian.
inside() {
    unshare --mount bash -euc '
        mount --make-rprivate /
        mount -t proc proc "$0/proc"
        mount --rbind /dev "$0/dev"
        exec chroot "$0" /usr/bin/env -i HOME=/root LANG=C.UTF-8 TERM=dumb PATH=/usr/sbin:/usr/bin:/sbin:/bin ${http_proxy:+http_proxy="$http_proxy"} \
            ${https_proxy:+https_proxy="$https_proxy"} CARGO_HTTP_CAINFO=/etc/ssl/certs/ca-certificates.crt RUSTC_BOOTSTRAP=1 \
            CARGO_TARGET_DIR=/built CARGO_BUILD_TARGET=x86_64-pc-windows-gnu CARGO_UNSTABLE_BUILD_STD=std,panic_unwind \
            CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER=x86_64-w64-mingw32-gcc-win32 \
            CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER=/usr/lib/wine/wine64 WINEDEBUG=-all WINEPREFIX=/wine \
            sh -euc "cd /flotor && $1"' "$root" "$1"
}
