//! The whole render that frames are of: what they are all made with, and how its fingerprint tells it from others.

use super::plan::{
    Files, check_focus, check_frames, check_rate, in_part, in_range, known_rate, views,
};
use super::{Event, SequenceError, SequenceOptions};
use crate::output::{ExrLayers, Format, PngBits};
use crate::scene::trajectory::{FrameName, FrameView, Views};
use crate::scene::{BackendChoice, Content, ContentHash, Exposure, Photo, Scene};
use crate::video::{FrameOutput, FrameSource, Matrix};

pub(super) struct Whole<'a> {
    pub options: &'a SequenceOptions,
    pub output: FrameOutput,
    pub files: &'a Files,
    pub views: Views<'a>,
    /// Frames a second, where known.
    pub rate: Option<f64>,
    /// The first and the last frame's number, where they are known: the focus is pulled between them.
    pub span: Option<(u32, u32)>,
    /// The frames of the range, where they are known.
    pub names: Option<Vec<FrameName>>,
}

/// Where the frames of `options` go: a name that promises what cannot be written is told before anything is read.
pub(super) fn output_of(options: &SequenceOptions) -> Result<FrameOutput, SequenceError> {
    let output = FrameOutput::of(&options.output, options.format)?;
    if !options.layers.is_empty() && output.format() != Some(Format::Exr) {
        return Err(SequenceError::Unfit(format!(
            "{}: it has no layers; expected EXR frames for --layers; give --format exr, or a name like out.####.exr",
            options.output.display()
        )));
    }
    Ok(output)
}

/// The frames of `options`, to be read.
pub(super) fn open_source(options: &SequenceOptions) -> Result<FrameSource, SequenceError> {
    let frames = options.frames.as_deref().ok_or_else(|| {
        SequenceError::Unfit(
            "--frames is absent; expected a folder of pictures, a .y4m file, or -; add it"
                .to_owned(),
        )
    })?;
    let mut source = FrameSource::open(frames)?;
    if let Some(matrix) = options.matrix {
        source.set_matrix(matrix);
    }
    Ok(source)
}

impl<'a> Whole<'a> {
    /// # Errors
    /// Frames and trajectory do not fit together, as far as can be known before the frames are read.
    pub fn new(
        options: &'a SequenceOptions,
        output: FrameOutput,
        files: &'a Files,
        source: &FrameSource,
        hear: &dyn Fn(&Event<'_>),
    ) -> Result<Self, SequenceError> {
        let rate = known_rate(options, &files.trajectory, Some(source));
        let views = views(options, &files.trajectory, rate, source.is_stream())?;
        check_frames(options, source, &views, hear)?;
        let names: Option<Vec<FrameName>> = source.names().map(|names| {
            names
                .into_iter()
                .filter(|name| in_range(options, name))
                .collect()
        });
        if let (Some((from, to)), None) = (options.focus_pull_m, &names)
            && options.range.is_none()
        {
            return Err(SequenceError::Unfit(format!(
                "--focus-pull {from}..{to} of a stream whose length is not known; expected a range; give --range"
            )));
        }
        Ok(Self {
            options,
            output,
            files,
            views,
            rate,
            span: span(options, source),
            names,
        })
    }

    /// The frames that this run renders and writes, where they are known.
    pub fn names_of_part(&self) -> Option<Vec<FrameName>> {
        let names = self.names.iter().flatten();
        let of_part = names.filter(|name| in_part(self.options, name));
        self.names.as_ref().map(|_| of_part.cloned().collect())
    }

    /// The scene, and the frames' size, which that of `photo` is.
    pub fn scene(
        &self,
        view: &FrameView,
        photo: &Photo,
        hear: &dyn Fn(&Event<'_>),
    ) -> Result<(Scene, (u32, u32)), SequenceError> {
        let given = Some(photo.clone());
        let mut scene = self.files.scene(self.options, view, given, hear)?;
        check_rate(&scene, self.rate, self.views.have_own_times())?;
        check_focus(self.options, &self.files.trajectory, &scene.lens)?;
        let size = (photo.width, photo.height);
        // The photograph of the moment is no part of what the frames are made with.
        let size = (scene.photo.take()).map_or(size, |photo| (photo.width, photo.height));
        Ok((scene, size))
    }

    /// Of all that the frames are made with but the photographs.
    pub fn fingerprint(&self, scene: &Scene) -> String {
        let options = self.options;
        let poses = &self.files.trajectory;
        let settings = &scene.settings;
        let may_be_gpu = settings.backend != BackendChoice::Cpu;
        let without = options.without.of_pictures(may_be_gpu);
        let png_bits = (options.png_bits).map(|bits| bits == PngBits::Sixteen);
        // What is fitted or pulled over the frames depends on which there are; a file tells by their order which it holds.
        let fits = settings.exposure == Exposure::Auto;
        let is_file = matches!(self.output, FrameOutput::Y4m(_));
        let scope = (fits || options.focus_pull_m.is_some() || is_file)
            .then_some((options.range, self.span));
        let mut hash = ContentHash::default();
        (env!("CARGO_PKG_VERSION"), scene.fingerprint()).add_to(&mut hash);
        (settings, &scene.stages).add_to(&mut hash);
        (without.names(), png_bits).add_to(&mut hash);
        format!("{:?} {:?}", options.filter, options.goal).add_to(&mut hash);
        (&poses.entries, (poses.intrinsics, self.files.intrinsics)).add_to(&mut hash);
        (self.rate, (options.focus_pull_m, scope)).add_to(&mut hash);
        options.matrix.map(Matrix::name).add_to(&mut hash);
        let names = self.names.as_deref().unwrap_or_default();
        self.views.folder_of(names).add_to(&mut hash);
        if self.output.format() == Some(Format::Exr) {
            format!("{:?}", ExrLayers::new(&options.layers, settings.composite)).add_to(&mut hash);
        }
        if let (Some(part), true) = (options.part, is_file) {
            part.add_to(&mut hash);
        }
        hash.finish()
    }
}

fn span(options: &SequenceOptions, source: &FrameSource) -> Option<(u32, u32)> {
    if let Some((from, to)) = options.range {
        return Some((from, to - 1));
    }
    let names = source.names()?;
    Some((names.first()?.number, names.last()?.number))
}
