//! Layouts that several tests use, from short descriptions.

use taxel_skin::Layout;

/// Boards of 16 taxels on one bus.
pub(crate) fn boards_on_a_bus(boards: usize) -> Layout {
    let mut text = "name = \"t\"\nimage = { width = 60, height = 4 }\nbuses = [\"can0\"]\n".to_string();
    for b in 0..boards {
        text += &format!(
            "[[module]]\nname = \"m{b}\"\npart = \"p\"\nbus = \"can0\"\nboard = {b}\nprotocol = \"uskin-l2\"\nat = [{}, 0]\n",
            4 * b
        );
    }
    Layout::parse(&text, "t.toml").unwrap()
}

/// The ten taxels of an iCub triangle, as a layout orders them.
pub(crate) fn icub_triangle(triangle: u32) -> String {
    let pads = [0, 1, 2, 3, 4, 5, 7, 8, 9, 11].map(|pad| (12 * triangle + pad).to_string());
    format!("[{}]", pads.join(", "))
}

/// One iCub board of this protocol with the ten taxels of triangles 0 and 3.
pub(crate) fn icub(protocol: &str, setup: &str) -> Layout {
    let text = format!(
        "name = \"icub\"\nimage = {{ width = 10, height = 2 }}\nbuses = [\"can0\"]\n[[module]]\nname = \"arm\"\n\
         part = \"arm\"\nbus = \"can0\"\nboard = 1\nprotocol = \"{protocol}\"\nat = [0, 0]\n{setup}\n\
         order = [{}, {}]\n",
        icub_triangle(0),
        icub_triangle(3)
    );
    Layout::parse(&text, "icub.toml").unwrap_or_else(|e| panic!("{e}"))
}

/// A variant of CySkin that a test assumes; nothing in the product does.
pub(crate) const CYSKIN: &str = "ids = \"extended\"\nbyte_order = \"big\"\nchecksum = \"sum\"\nsequence_bytes_above = 5\n\
     sensors_per_module = 12\n";

/// Hubs 0x123 and 0x124 on one bus, 0x23 and 0x24 where ids are standard, with `modules` modules of seven
/// taxels (sensors 1 to 7) each.
pub(crate) fn cyskin_text(parameters: &str, modules: u32) -> String {
    let [a, b] = match parameters.contains("\"extended\"") {
        true => [0x123, 0x124],
        false => [0x23, 0x24],
    };
    let mut text = format!(
        "name = \"cy\"\nimage = {{ width = 1000, height = 40 }}\nbuses = [\"can0\"]\n[cyskin]\n{parameters}\n\
         [[cyskin.hub]]\nname = \"a\"\nbus = \"can0\"\naddress = {a:#x}\n\
         [[cyskin.hub]]\nname = \"b\"\nbus = \"can0\"\naddress = {b:#x}\n"
    );
    for (row, hub) in ["a", "b"].into_iter().enumerate() {
        for m in 0..modules {
            text += &format!(
                "[[module]]\nname = \"{hub}{m}\"\npart = \"{hub}\"\nbus = \"can0\"\nhub = \"{hub}\"\nboard = {m}\n\
                 protocol = \"cyskin\"\nat = [{}, {}]\norder = [[1, 2, 3, 4, 5, 6, 7]]\n",
                m % 140 * 7,
                row * 20 + m as usize / 140
            );
        }
    }
    text
}

pub(crate) fn cyskin(parameters: &str, modules: u32) -> Layout {
    Layout::parse(&cyskin_text(parameters, modules), "cy.toml").unwrap_or_else(|e| panic!("{e}"))
}
