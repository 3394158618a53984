//! Linker arguments: soname; no unloading (`nodelete`), because the library's threads keep running; symbolic binding of calls
//! within the library.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        for argument in ["-soname,libhdPhantom.so", "-z,nodelete", "-Bsymbolic"] {
            println!("cargo:rustc-cdylib-link-arg=-Wl,{argument}");
        }
    }
}
