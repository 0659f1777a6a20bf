//! What header comments say about how a cloud was trained.

use splat_core::Source;

/// Whether the comments ask for the antialiased low-pass form. Two writers do so, in either case, and the last line
/// counts: `SplatRenderMode: mip` and `antialiased 1`.
pub(crate) fn antialiased(comments: &[String]) -> bool {
    let mut found = false;
    for comment in comments {
        let comment = comment.trim().to_ascii_lowercase();
        if let Some(mode) = comment.strip_prefix("splatrendermode:") {
            found = mode.trim() == "mip";
        } else if let Some(flag) = comment.strip_prefix("antialiased") {
            match flag.trim() {
                "0" => found = false,
                "1" => found = true,
                _ => {}
            }
        }
    }
    found
}

/// The comments of a file for this source; says the low-pass form if they do not do so yet.
pub(crate) fn to_write(source: &Source) -> Vec<String> {
    // A line break would end the comment and start a property.
    let mut comments: Vec<String> = source.comments.iter().map(|c| c.replace(['\n', '\r'], " ")).collect();
    if antialiased(&comments) != source.antialiased {
        comments.push(format!("SplatRenderMode: {}", if source.antialiased { "mip" } else { "default" }));
    }
    comments
}
