//! `relens completions` and `relens man`: what the package brings for shells and for `man`, made of
//! the command line's declaration.

use std::path::PathBuf;

use clap::{Args, Command, ValueHint};
use clap_complete::Shell;
use clap_mangen::Man;

use super::error::CliError;
use super::output::say;

/// Print the completions for a shell
#[derive(Debug, Args)]
pub(super) struct CompletionsOptions {
    /// Shell that asks
    shell: Shell,
}

/// Print the manual page relens(1), or write the pages of all commands
#[derive(Debug, Args)]
pub(super) struct ManOptions {
    /// Write the pages into this folder, which must exist
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    out: Option<PathBuf>,
}

/// `relens completions`, for what is declared by `command`.
pub(super) fn completions(
    options: &CompletionsOptions,
    mut command: Command,
) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut command, "relens", &mut script);
    say(String::from_utf8_lossy(&script).trim_end());
    Ok(())
}

/// `relens man`, for what is declared by `command`.
pub(super) fn man(options: &ManOptions, command: Command) -> Result<(), CliError> {
    let mut whole = command.disable_help_subcommand(true);
    whole.build();
    let Some(folder) = &options.out else {
        say(page(whole).1.trim_end());
        return Ok(());
    };
    let commands = whole.get_subcommands().filter(|command| !command.is_hide_set()).cloned();
    for command in commands.chain([whole.clone()]) {
        let (name, page) = page(command);
        let path = folder.join(name);
        std::fs::write(&path, page).map_err(|e| CliError::writing(&path, e))?;
    }
    Ok(())
}

/// `page` with what follows a command's help, its examples, under their name and line by line: a
/// broken one cannot be copied.
fn with_examples(page: &str) -> String {
    let Some((before, from)) = page.split_once(".SH EXTRA\nExamples:\n") else {
        return page.to_owned();
    };
    let (examples, after) = from.split_once(".SH ").unwrap_or((from, ""));
    let next = if after.is_empty() { "" } else { ".SH " };
    format!("{before}.SH EXAMPLES\n.nf\n{examples}.fi\n{next}{after}")
}

/// A command's page and the name of its file.
fn page(command: Command) -> (String, String) {
    let man = Man::new(command).source(concat!("relens ", env!("CARGO_PKG_VERSION")));
    let mut page = Vec::new();
    // Memory takes everything.
    let _ = man.render(&mut page);
    (man.get_filename(), with_examples(&String::from_utf8_lossy(&page)))
}
