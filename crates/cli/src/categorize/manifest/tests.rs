use super::*;

#[test]
fn a_line_is_counted_alike_whatever_ends_lines() {
    for end in ["\n", "\r\n"] {
        let text = [
            "# touches",
            "",
            "file,label",
            "a.npz,x",
            "",
            "# more",
            "b.npz,y",
            "c.npz,z",
        ]
        .join(end);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("touches.csv");
        std::fs::write(&path, text).unwrap();
        assert!(is_manifest(&path).unwrap());
        let jobs = read_manifest(&path, &ReadOptions::default()).unwrap();
        let lines: Vec<u64> = jobs[0].rows.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [4, 7, 8], "{end:?}");
    }
}

#[test]
fn a_touch_of_a_file_ends_at_the_latest_where_the_next_begins() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("touches.csv");
    let text = "file,time,phantom\na.npz,2,A\na.npz,,A\na.npz,1.5,B\nb.npz,1,A\na.npz,2,A\n";
    std::fs::write(&path, text).unwrap();
    let jobs = read_manifest(&path, &ReadOptions::default()).unwrap();
    let next: Vec<_> = jobs
        .iter()
        .flat_map(|job| &job.rows)
        .map(|(_, row)| row.next)
        .collect();
    assert_eq!(next, [None, Some(1.5), None, None, Some(2.0)]);
}
