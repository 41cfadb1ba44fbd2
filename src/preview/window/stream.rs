//! A window on a running stream: its newest frame, and how it goes.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use eframe::egui::{
    self, Color32, ColorImage, Context, Key, Rect, TextureHandle, TextureOptions, Ui,
    ViewportCommand, pos2,
};

use super::{WindowError, open};

/// Between the stream, which fills it, and the window, which shows what is newest.
#[derive(Default)]
pub struct StreamFeed(Mutex<Feed>);

#[derive(Default)]
struct Feed {
    newest: Option<ColorImage>,
    words: String,
    is_over: bool,
    /// Of the window, once it is there.
    context: Option<Context>,
}

impl StreamFeed {
    fn feed(&self) -> MutexGuard<'_, Feed> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, how: impl FnOnce(&mut Feed)) {
        let mut feed = self.feed();
        how(&mut feed);
        if let Some(context) = &feed.context {
            context.request_repaint();
        }
    }

    /// In place of the frame before, shown or not; sRGB codes, row-major.
    pub fn show(&self, size: [usize; 2], codes: &[[u8; 3]]) {
        let image = ColorImage::from_rgb(size, codes.as_flattened());
        self.change(|feed| feed.newest = Some(image));
    }

    /// A line under the picture.
    pub fn say(&self, words: String) {
        self.change(|feed| feed.words = words);
    }

    /// Nothing more comes: the window closes.
    pub fn end(&self) {
        self.change(|feed| feed.is_over = true);
    }
}

/// The state of the window.
pub struct StreamApp {
    feed: Arc<StreamFeed>,
    picture: Option<TextureHandle>,
}

impl StreamApp {
    pub fn new(feed: Arc<StreamFeed>) -> Self {
        Self {
            feed,
            picture: None,
        }
    }

    /// Of the frame that is shown.
    pub fn size(&self) -> Option<[usize; 2]> {
        self.picture.as_ref().map(TextureHandle::size)
    }

    /// Draws a frame.
    pub fn show(&mut self, ui: &mut Ui) {
        let (newest, words, is_over) = {
            let mut feed = self.feed.feed();
            feed.context.get_or_insert_with(|| ui.ctx().clone());
            (feed.newest.take(), feed.words.clone(), feed.is_over)
        };
        if let Some(image) = newest {
            let options = TextureOptions::LINEAR;
            match &mut self.picture {
                Some(picture) => picture.set(image, options),
                none => *none = Some(ui.ctx().load_texture("stream", image, options)),
            }
        }
        egui::Panel::bottom("status").show(ui, |ui| ui.label(words));
        egui::CentralPanel::no_frame().show(ui, |ui| {
            if let Some(picture) = &self.picture {
                let room = ui.max_rect();
                let [scale_x, scale_y] =
                    [0, 1].map(|axis| room.size()[axis] / picture.size_vec2()[axis]);
                let size = picture.size_vec2() * scale_x.min(scale_y);
                let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
                let place = Rect::from_center_size(room.center(), size);
                ui.painter()
                    .image(picture.id(), place, whole, Color32::WHITE);
            }
        });
        if is_over || ui.ctx().input(|input| input.key_pressed(Key::Escape)) {
            ui.ctx().send_viewport_cmd(ViewportCommand::Close);
        }
    }
}

impl eframe::App for StreamApp {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show(ui);
    }
}

/// Shows the stream until Esc, or its end, closes the window.
///
/// # Errors
/// There is no display, or no graphics driver.
pub fn show_stream(title: &str, feed: &Arc<StreamFeed>) -> Result<(), WindowError> {
    let feed = Arc::clone(feed);
    open(
        title,
        [960.0, 760.0],
        Box::new(move |_| Ok(Box::new(StreamApp::new(feed)))),
    )
}

#[cfg(test)]
mod tests {
    use eframe::egui::ViewportId;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    fn closes(window: &Harness<'_, StreamApp>) -> bool {
        let commands = &window.output().viewport_output[&ViewportId::ROOT].commands;
        commands.contains(&ViewportCommand::Close)
    }

    fn window(feed: &Arc<StreamFeed>) -> Harness<'static, StreamApp> {
        let draw = |ui: &mut Ui, app: &mut StreamApp| app.show(ui);
        Harness::builder().build_ui_state(draw, StreamApp::new(Arc::clone(feed)))
    }

    #[test]
    fn the_newest_frame_is_shown_until_escape_or_the_end() {
        let feed = Arc::new(StreamFeed::default());
        let mut window = window(&feed);
        assert_eq!(window.state().size(), None);
        feed.show([4, 3], &[[9; 3]; 12]);
        feed.show([6, 5], &[[90; 3]; 30]);
        feed.say("12 of 25 frames/s".to_owned());
        window.step();
        assert_eq!(window.state().size(), Some([6, 5]));
        window.get_by_label("12 of 25 frames/s");
        assert!(!closes(&window), "control");
        window.key_down(Key::Escape);
        window.step();
        assert!(closes(&window));

        let mut other = self::window(&feed);
        feed.end();
        other.step();
        assert!(closes(&other));
    }
}
