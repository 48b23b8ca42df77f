//! Comma-separated values.

/// The cells of comma-separated values, row by row, the head first.
pub(crate) fn cells_of_csv(text: &str) -> Vec<Vec<String>> {
    let (mut rows, mut row, mut cell) = (Vec::new(), Vec::new(), String::new());
    let mut is_quoted = false;
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '"' if is_quoted && letters.next_if_eq(&'"').is_some() => cell.push('"'),
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => row.push(std::mem::take(&mut cell)),
            '\n' if !is_quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push(std::mem::take(&mut row));
            }
            letter => cell.push(letter),
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    #[test]
    fn cells_of_a_table_are_read_back() {
        let mut table = relens::chart::table::Table::new("Two things.", &["name", "value"]);
        table.row(vec!["\"a\", b".to_owned(), String::new()]);
        assert_eq!(super::cells_of_csv(&table.csv())[1..], table.rows);
    }
}
