//! Links the shaders, and tells technique crates where the shared modules lie.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "gpu")]
    gnomon_shader_build::build();
}
