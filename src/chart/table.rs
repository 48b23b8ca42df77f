//! Tables, written as Markdown and as CSV.

/// A table: caption, head, and rows of the same length.
#[derive(Debug, Clone, Default)]
pub struct Table {
    /// Sentences above the table.
    pub caption: String,
    /// Column heads.
    pub head: Vec<&'static str>,
    /// Cells, row by row.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new(caption: impl Into<String>, head: &[&'static str]) -> Self {
        Table { caption: caption.into(), head: head.to_vec(), rows: Vec::new() }
    }

    /// Builds a table from rows of (head, cell) pairs; the heads are the same in all rows.
    pub(super) fn of_rows(
        caption: String,
        rows: impl Iterator<Item = Vec<(&'static str, String)>>,
    ) -> Self {
        let mut table = Table::new(caption, &[]);
        for row in rows {
            let (head, cells) = row.into_iter().unzip();
            table.head = head;
            table.row(cells);
        }
        table
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let mut text = format!(
            "{}\n\n| {} |\n|{}\n",
            self.caption,
            self.head.join(" | "),
            "---|".repeat(self.head.len())
        );
        for row in &self.rows {
            let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            text.push_str(&format!("| {} |\n", cells.join(" | ")));
        }
        text
    }

    /// The table as comma-separated values without the caption.
    pub fn csv(&self) -> String {
        let quoted = |cell: &str| {
            if cell.contains([',', '"', '\n']) {
                format!("\"{}\"", cell.replace('"', "\"\""))
            } else {
                cell.to_owned()
            }
        };
        let head = self.head.iter().map(|cell| quoted(cell)).collect::<Vec<_>>();
        let rows = self.rows.iter().map(|row| row.iter().map(|cell| quoted(cell)).collect());
        let lines = std::iter::once(head).chain(rows);
        lines.map(|cells: Vec<String>| cells.join(",") + "\n").collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_survive_markdown_and_csv() {
        let mut table = Table::new("Two things.", &["name", "value"]);
        table.row(vec!["a|b".to_owned(), "1,5".to_owned()]);
        assert!(table.markdown().contains("| a\\|b | 1,5 |"));
        assert_eq!(table.csv(), "name,value\na|b,\"1,5\"\n");
        table.row(vec!["\"a\"".to_owned(), String::new()]);
        assert!(table.csv().ends_with("\"\"\"a\"\"\",\n"), "{}", table.csv());
    }
}
