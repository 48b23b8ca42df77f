//! The page that shows all figures.

use std::fmt::Write;

use super::Figure;

/// A page in Markdown with every figure; `command` is what makes them again.
pub fn page(figures: &[Figure], rig: &str, command: &str) -> String {
    let mut out = String::new();
    // Writing to a string does not fail.
    let _ = write(&mut out, figures, rig, command);
    out
}

fn write(out: &mut String, figures: &[Figure], rig: &str, command: &str) -> std::fmt::Result {
    writeln!(out, "# The paper's figures, measured again\n")?;
    writeln!(
        out,
        "Made by `{command}` on rig {rig}: ray-traced lens, 8-bit panel and camera, scenes whose \
         truth is known; green \
         channel, light 0..255. Sizes in pixels are given as the paper has them, for a photo 1024 \
         wide; the rig's own \
         are smaller in proportion. The words are written by the program from the numbers below \
         them.\n"
    )?;
    writeln!(out, "| figure | | |\n|---|---|---|")?;
    for figure in figures {
        let anchor = format!("#figure-{}", figure.number);
        writeln!(
            out,
            "| [{}]({anchor}) | {} | {} |",
            figure.number,
            figure.title,
            figure.agreement.words()
        )?;
    }
    for figure in figures {
        writeln!(
            out,
            "\n## Figure {}\n\n{}. **{}** {}\n",
            figure.number,
            figure.title,
            figure.agreement.words(),
            figure.text
        )?;
        for (suffix, _) in &figure.drawings {
            writeln!(out, "![{}]({}{suffix}.svg)\n", figure.title, figure.stem)?;
        }
        for (suffix, seen, _) in &figure.pictures {
            writeln!(out, "![{seen}]({}{suffix}.png)\n\n*{seen}*\n", figure.stem)?;
        }
        writeln!(out, "{}", figure.table.markdown())?;
    }
    Ok(())
}
