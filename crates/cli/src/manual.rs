//! What shells and `man` are told of the commands; packages install it.

use anyhow::Context;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use taxel_skin::Layout;
use taxeld::stdout;

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
    let mut script = String::from_utf8(script)?;
    if args.shell == Shell::Bash {
        offer_files(&mut script, &taxel, "taxel");
        let names: Vec<&str> = Layout::builtin_names().collect();
        let hands = format!("{LAYOUT}$(compgen -W \"{}\" -f -- \"${{cur}}\")", names.join(" "));
        script = script.replace(&format!("{LAYOUT}$(compgen -f \"${{cur}}\")"), &hands);
    }
    stdout::print(&script)
}

/// What bash is told of the value of an option `--layout`, up to the values.
const LAYOUT: &str = "                --layout)\n                    COMPREPLY=(";

/// Where nothing is typed yet and the command takes a file, bash is to offer files, as it does where nothing of ours fits.
fn offer_files(script: &mut String, command: &clap::Command, name: &str) {
    for command in command.get_subcommands() {
        let name = format!("{name}__subcmd__{}", command.get_name());
        offer_files(script, command, &name);
        let mut positional = command.get_positionals();
        if !positional.any(|argument| argument.get_possible_values().is_empty()) {
            continue;
        }
        let begin = format!("        {name})\n            opts=");
        if let Some(at) = script.find(&begin)
            && let Some(end) = script[at + begin.len()..].find('\n')
        {
            let leave = "            [[ -z \"${cur}\" && \"${prev}\" != -* ]] && return 0\n";
            script.insert_str(at + begin.len() + end + 1, leave);
        }
    }
}

pub(crate) fn man(args: &ManArgs, mut taxel: clap::Command) -> anyhow::Result<()> {
    let folder = &args.folder;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    taxel = taxel.disable_help_subcommand(true);
    // Commands have their whole names from here on.
    taxel.build();
    write_pages(folder, &taxel, "1")?;
    write_pages(folder, &taxeld::Arguments::command(), "8")
}

/// The page of a command, and those of its own commands, to which it refers.
fn write_pages(folder: &Path, command: &clap::Command, section: &str) -> anyhow::Result<()> {
    for command in command.get_subcommands().filter(|command| !command.is_hide_set()) {
        write_pages(folder, command, section)?;
    }
    let name = command.get_display_name().unwrap_or(command.get_name());
    let path = folder.join(format!("{name}.{section}"));
    let mut page = Vec::new();
    let made = humantime::format_rfc3339(made()).to_string();
    Man::new(command.clone())
        .section(section)
        .date(&made[.."2026-11-20".len()])
        .source(concat!("taxeld ", env!("CARGO_PKG_VERSION")))
        .render(&mut page)?;
    let page = improved(&String::from_utf8(page)?, command);
    fs::write(&path, page).with_context(|| format!("cannot write {}", path.display()))
}

/// When the pages were made, as builds that are to give the same bytes again say: `SOURCE_DATE_EPOCH`, seconds.
fn made() -> SystemTime {
    let said = std::env::var("SOURCE_DATE_EPOCH").ok();
    let seconds = said.and_then(|seconds| seconds.parse::<u32>().ok());
    seconds.map_or_else(SystemTime::now, |seconds| {
        UNIX_EPOCH + Duration::from_secs(seconds.into())
    })
}

/// What clap_mangen leaves to be done: values of options in the synopsis, what follows the options as it was written, and
/// pages where packages have them.
fn improved(page: &str, command: &clap::Command) -> String {
    let (head, extra) = page.split_once(".SH EXTRA\n").unwrap_or((page, ""));
    let mut synopsis = true;
    let mut text = String::new();
    for line in head.lines() {
        synopsis &= !line.starts_with(".SH DESCRIPTION");
        text += &match synopsis {
            true => with_values(line, command),
            false => line.to_owned(),
        };
        text.push('\n');
    }
    if !extra.is_empty() {
        // Words that are not to be broken: commands, and keys of JSON.
        text += ".SH EXAMPLES AND NOTES\n.nh\n.ad l\n";
    }
    let mut as_it_is = false;
    for line in extra.lines() {
        if as_it_is != line.starts_with(' ') {
            as_it_is = !as_it_is;
            text += if as_it_is { ".nf\n" } else { ".fi\n" };
        }
        text += line;
        text.push('\n');
    }
    text.replace("docs/", "/usr/share/doc/taxeld/")
}

/// A line of the synopsis with the value that each option takes.
fn with_values(line: &str, command: &clap::Command) -> String {
    let mut line = line.to_owned();
    for option in command
        .get_arguments()
        .filter(|argument| !argument.is_positional())
    {
        let takes = option.get_action().takes_values();
        let (Some(long), Some(values), true) = (option.get_long(), option.get_value_names(), takes) else {
            continue;
        };
        let name = format!("\\fB\\-\\-{}\\fR", long.replace('-', "\\-"));
        let with_value = format!("{name} \\fI{}\\fR", values.join(" ").replace('-', "\\-"));
        line = line.replace(&format!("<{name}>"), &with_value);
        line = line.replace(&format!("[{name}]"), &format!("[{with_value}]"));
    }
    line
}
