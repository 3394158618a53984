//! Pictures: what programs that draw SVG have to know.

use flotor_tests::workspace_root;
use std::path::PathBuf;

/// The pictures of the book that Flotor draws.
fn pictures_of_the_book() -> Vec<PathBuf> {
    let images = workspace_root().join("docs/src/images");
    let folders = [images.join("scenes"), images];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("it is there"));
    let files = files.map(|file| file.expect("it can be read").path());
    files.filter(|file| file.extension().is_some_and(|ending| ending == "svg")).collect()
}

/// CairoSVG draws nothing if the root has a height of its own in its style, svglib no colour but a plain one and nothing in a nested
/// document. What else a picture may hold is tested where it is drawn, in `flotor-plot`.
#[test]
fn every_picture_of_the_book_is_drawn_by_every_program() {
    let pictures = pictures_of_the_book();
    assert!(pictures.len() >= 15, "{pictures:?}");
    for picture in pictures {
        let svg = std::fs::read_to_string(&picture).expect("it is text");
        assert_eq!(svg.matches("<svg").count(), 1, "{}: a nested document", picture.display());
        for unknown in ["currentColor", "height:auto", "var(", "<clipPath"] {
            assert!(!svg.contains(unknown), "{}: {unknown}", picture.display());
        }
    }
}
