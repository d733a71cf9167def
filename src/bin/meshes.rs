//! Writes the meshes of `assets/meshes` anew from their generators; run by `scripts/meshes`.

use std::path::Path;
use std::process::ExitCode;

use shadow_fields::asset::generate::library;
use shadow_fields::asset::obj::write_obj;

#[allow(clippy::print_stderr)]
fn main() -> ExitCode {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/meshes");
    for mesh in library() {
        let path = folder.join(format!("{}.obj", mesh.name));
        if let Err(error) = std::fs::write(&path, write_obj(&mesh)) {
            eprintln!("{}: {error}", path.display());
            return ExitCode::from(1);
        }
    }
    ExitCode::SUCCESS
}
