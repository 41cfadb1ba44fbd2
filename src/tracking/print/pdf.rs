//! A sheet as PDF.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};

use super::{ADVICE, LETTERS_MM, LINE_MM, Sheet};

/// Of PDF's points an inch has 72.
const POINTS_PER_MM: f32 = 72.0 / 25.4;
const FONT: Name = Name(b"F");

impl Sheet {
    /// One page of the sheet's size.
    pub fn pdf(&self) -> Vec<u8> {
        let [width, height] = [self.size.x, self.size.y].map(|mm| mm as f32 * POINTS_PER_MM);
        let [catalog, pages, page, font, contents] = [1, 2, 3, 4, 5].map(Ref::new);
        let mut pdf = Pdf::new();
        pdf.catalog(catalog).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let mut sheet = pdf.page(page);
        sheet.media_box(Rect::new(0.0, 0.0, width, height));
        sheet.parent(pages).contents(contents);
        sheet.resources().fonts().pair(FONT, font);
        sheet.finish();
        pdf.type1_font(font).base_font(Name(b"Helvetica"));
        pdf.stream(contents, &self.content(height).finish());
        pdf.finish()
    }

    fn content(&self, height: f32) -> Content {
        let mut content = Content::new();
        // Millimetres, and y down.
        content.transform([POINTS_PER_MM, 0.0, 0.0, -POINTS_PER_MM, 0.0, height]);
        for square in &self.squares {
            let [first, others @ ..] = square.map(|p| p.as_vec2());
            content.move_to(first.x, first.y);
            for corner in others {
                content.line_to(corner.x, corner.y);
            }
            content.close_path();
            content.fill_nonzero();
        }
        for (corner, length) in &self.ruler {
            let corner = corner.as_vec2();
            content.rect(corner.x, corner.y, LINE_MM as f32, *length as f32);
            content.fill_nonzero();
        }
        let at = self.advice.as_vec2();
        content.begin_text();
        content.set_font(FONT, LETTERS_MM as f32);
        content.set_text_matrix([1.0, 0.0, 0.0, -1.0, at.x, at.y]);
        content.show(Str(ADVICE.as_bytes()));
        content.end_text();
        content
    }
}
