// Twin of src/stages/noise/mod.rs.

import package::stages::noise::gpu::{params, photo, picture};

fn is_untouched(index: u32) -> bool {
    if params.has_photo == 0u {
        return false;
    }
    for (var c = 0u; c < 3u; c++) {
        if bitcast<u32>(photo[3u * index + c]) != bitcast<u32>(picture[3u * index + c]) {
            return false;
        }
    }
    return true;
}
