//! C programs compiled against the C reader.

use std::path::Path;
use std::process::Command;

/// Compiles a C program of this repository against the C reader, under the sanitizers where there are any.
/// None, and a loud line, where this machine has no C compiler.
pub(crate) fn compile(source: &str, program: &Path) -> Option<()> {
    let cc = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let run = |more: &[&str]| {
        Command::new(&cc)
            .args([
                "-std=c99",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                "-O1",
                "-g",
                "-I",
            ])
            .arg(here.join("c"))
            .args(more)
            .arg(here.join(source))
            .arg("-o")
            .arg(program)
            .output()
    };
    let sanitizers = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    let mut compiled = match run(&sanitizers) {
        Ok(compiled) => compiled,
        Err(error) => {
            println!("SKIPPED: no C compiler ({error}); {source} was NOT compiled or run");
            return None;
        }
    };
    if !compiled.status.success() {
        compiled = run(&[]).unwrap();
        if compiled.status.success() {
            println!("SKIPPED: this C compiler has no sanitizers; {source} runs WITHOUT them");
        }
    }
    assert!(
        compiled.status.success(),
        "{}",
        String::from_utf8_lossy(&compiled.stderr)
    );
    Some(())
}
