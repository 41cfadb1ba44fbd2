//! A scene to begin with: the board's plane as a real proxy, and a first box on it.

use std::fmt::Write;

use glam::DVec3;

use super::session::Session;

/// Around the outermost points the plane goes on by this share of the board's extent: paper has a margin.
const MARGIN: f64 = 0.15;

impl Session {
    /// For `mixray sequence` with the trajectory of the same run: TOML.
    pub fn starter_scene(&self) -> String {
        let points = &self.tracked.solution.points;
        let (least, most) = points
            .iter()
            .fold((DVec3::MAX, DVec3::MIN), |(a, b), p| (a.min(*p), b.max(*p)));
        let extent = (most - least).max_element();
        let margin = MARGIN * extent;
        let middle = 0.5 * (least + most);
        let size = most - least + 2.0 * margin;
        let side = 0.2 * extent;
        let lens = &self.tracked.solution.lens;
        let [fx, fy, cx, cy, ..] = lens.parameters();
        let mut text =
            String::from("# The board as `mixray track` found it, and a first object on it.\n\n");
        let mut line = |words: std::fmt::Arguments<'_>| {
            // Writing to a string does not fail.
            let _ = text.write_fmt(words);
        };
        line(format_args!(
            "[camera]                                # also in the trajectory\nwidth = {}\nheight = {}\nfx = {fx:.3}\nfy = {fy:.3}\ncx = {cx:.3}\ncy = {cy:.3}\n",
            self.tracked.width, self.tracked.height
        ));
        if lens.distortion.model == crate::distortion::LENS_RADIAL {
            let [k1, k2, p1, p2, k3, ..] = lens.distortion.coefficients;
            line(format_args!(
                "distortion = [{k1:.6}, {k2:.6}, {p1:.6}, {p2:.6}, {k3:.6}]\n"
            ));
        }
        if let Some(pose) = self
            .tracked
            .frames
            .iter()
            .find_map(|frame| frame.pose.as_ref().ok())
        {
            let matrix = pose.fit.pose.world_from_camera();
            let rows: Vec<String> = (0..4)
                .map(|row| format!("{:?}", matrix.row(row).to_array()))
                .collect();
            line(format_args!("world_from_camera = [{}]\n", rows.join(", ")));
        }
        match self.rows.map(|rows| rows.readout_secs) {
            None => {}
            Some(secs) if secs >= 0.0 => line(format_args!(
                "\n[shutter]                               # rows as they were read, one after the other\nexposure_secs = 0.0                     # how long each is open: what moves is blurred by it\nreadout_secs = {secs:.6}\n"
            )),
            Some(secs) => line(format_args!(
                "\n# Rows were read from the lowest up, in {:.1} ms; [shutter] reads them from the first down.\n",
                -1e3 * secs
            )),
        }
        line(format_args!(
            "\n[environment]                           # the light of the place: replace it by a light probe\nradiance = [0.3, 0.3, 0.3]\n\n[[light]]\nkind = \"quad\"\ncorner = [{:.3}, {:.3}, {:.3}]\nedge_u = [{extent:.3}, 0.0, 0.0]\nedge_v = [0.0, 0.0, {extent:.3}]                # u x v points down\nradiance = [3.0, 3.0, 3.0]\n",
            middle.x - extent,
            middle.y + 4.0 * extent,
            middle.z - extent
        ));
        line(format_args!(
            "\n[[real]]                                # the board's plane; its colours are taken from the frames\nshape = \"quad\"\nname = \"board\"\ncorner = [{:.4}, {:.4}, {:.4}]\nedge_u = [{:.4}, 0.0, 0.0]\nedge_v = [0.0, 0.0, {:.4}]\n",
            least.x - margin,
            middle.y,
            most.z + margin,
            size.x,
            -size.z
        ));
        line(format_args!(
            "\n[[virtual]]\nshape = \"box\"\nname = \"box\"\nsize = [{side:.4}, {side:.4}, {side:.4}]\ntranslation = [{:.4}, {:.4}, {:.4}]\nmaterial = {{ base_color = [0.60, 0.08, 0.05], roughness = 0.4 }}\n\n[render]\nrays_per_pixel = 16\ncomposite = \"quotient\"               # shadows whatever the light's strength, which is guessed\n",
            middle.x,
            middle.y + 0.5 * side + 1e-4,
            middle.z
        ));
        text
    }
}
