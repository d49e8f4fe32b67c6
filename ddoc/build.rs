//! Links the shaders.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "gpu")]
    gnomon_shader_build::build();
}
