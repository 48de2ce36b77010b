//! What shells and `man` are told of the commands; packages install it.

use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Print what completes the commands and options of `taxel` in a shell.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  taxel completions bash > ~/.local/share/bash-completion/completions/taxel
  taxel completions fish > ~/.config/fish/completions/taxel.fish")]
pub(crate) struct CompletionsArgs {
    /// The shell
    shell: Shell,
}

/// Write the manual pages of taxel, of each of its commands and of taxeld into a folder.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// The folder; made where it is missing
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

pub(crate) fn completions(args: &CompletionsArgs, mut taxel: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut taxel, "taxel", &mut script);
    Ok(io::stdout().write_all(&script)?)
}

pub(crate) fn man(args: &ManArgs, mut taxel: clap::Command) -> anyhow::Result<()> {
    let folder = &args.folder;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    taxel = taxel.disable_help_subcommand(true);
    // Commands have their whole names from here on.
    taxel.build();
    for command in taxel.get_subcommands().filter(|command| !command.is_hide_set()) {
        write_page(folder, command.clone(), "1")?;
    }
    write_page(folder, taxel, "1")?;
    write_page(folder, taxeld::Arguments::command(), "8")
}

fn write_page(folder: &Path, command: clap::Command, section: &str) -> anyhow::Result<()> {
    let name = command.get_display_name().unwrap_or(command.get_name());
    let path = folder.join(format!("{name}.{section}"));
    let mut page = Vec::new();
    Man::new(command).section(section).render(&mut page)?;
    fs::write(&path, page).with_context(|| format!("cannot write {}", path.display()))
}
