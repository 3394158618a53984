//! Linker arguments: name of the library; no unloading, because its threads go on; binding of its own calls within the library.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        for argument in ["-soname,libHD.so.3.4", "-z,nodelete", "-Bsymbolic"] {
            println!("cargo:rustc-cdylib-link-arg=-Wl,{argument}");
        }
    }
}
