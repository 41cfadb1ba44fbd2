"""What "photograph less average of a burst" measures beside noise.

    python3 benches/peers/noise_pairs.py ../shared/data/polyu_noise_pairs    # pip install numpy opencv-python-headless

For each pair NAME_real.jpg, NAME_mean.jpg, in flat parts of the average (its 9 x 9 neighbourhood varies by less than 2 DN) and at its edges (by more
than 12):

- sigma of the difference, DN;
- displaced: the share of the difference's variance that the average's own slopes and curvature explain, block by block of 32 x 32 pixels: what
  another place of the camera or another sharpness leaves, which noise does not know of. Five per mille are chance;
- known: the same sigma over the sigma that was put in, where the average itself is the scene, correlated noise as strong as that of the flat parts is added
  to it, and both are stored as JPEG of quality 75 as the pairs are. What is not 1 is made by JPEG alone.
"""

import pathlib
import sys

import cv2
import numpy as np

BLOCK = 32


def variation(mean):
    grey = mean.mean(2)
    size = (9, 9)
    return np.sqrt(np.maximum(cv2.blur(grey * grey, size) - cv2.blur(grey, size) ** 2, 0))


def sigma(difference, where):
    return np.sqrt(np.mean([difference[..., c][where].var() for c in range(3)]))


def displaced(difference, mean, where):
    """Share of the variance at `where` that follows the slopes and the curvature of the mean, each block's own."""
    explained = total = 0.0
    for y in range(0, where.shape[0] - BLOCK + 1, BLOCK):
        for x in range(0, where.shape[1] - BLOCK + 1, BLOCK):
            block = np.s_[y : y + BLOCK, x : x + BLOCK]
            chosen = where[block]
            if chosen.sum() < 300:
                continue
            # One shift for all channels.
            target = np.concatenate([difference[block][chosen][:, c] for c in range(3)])
            columns = [
                np.concatenate([cv2.Sobel(mean[..., c], cv2.CV_64F, dx, dy, ksize=3)[block][chosen] for c in range(3)])
                for dx, dy in ((1, 0), (0, 1), (2, 0), (0, 2))
            ]
            target = target - target.mean()
            matrix = np.stack(columns, 1)
            matrix = matrix - matrix.mean(0)
            fitted = matrix @ np.linalg.lstsq(matrix, target, rcond=None)[0]
            explained += (fitted**2).sum()
            total += (target**2).sum()
    return explained / total if total else float("nan")


def stored(picture):
    codes = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return cv2.imdecode(cv2.imencode(".jpg", codes, [cv2.IMWRITE_JPEG_QUALITY, 75])[1], 1).astype(float)


def grain(shape, random):
    """Unit deviates, alike by about 0.55 in neighbours."""
    noise = cv2.GaussianBlur(random.standard_normal(shape), (0, 0), 0.65)
    return noise / noise.std()


def main():
    folder = pathlib.Path(sys.argv[1])
    random = np.random.default_rng(1)
    print(f"{'':40} {'flat':>6} {'known':>6} | {'edges':>6} {'displaced':>9} {'known':>6}")
    rows = []
    for path in sorted(folder.glob("*_real.jpg")):
        real = cv2.imread(str(path)).astype(float)
        mean = cv2.imread(str(path).replace("_real", "_mean")).astype(float)
        spread = variation(mean)
        flat, edges = spread < 2, spread > 12
        if flat.sum() < 2000 or edges.sum() < 2000:
            continue
        of_flat, of_edges = sigma(real - mean, flat), sigma(real - mean, edges)
        made = stored(mean + of_flat * grain(mean.shape, random)) - stored(mean)
        row = (
            of_flat,
            sigma(made, flat) / of_flat,
            of_edges,
            displaced(real - mean, mean, edges),
            sigma(made, edges) / of_flat,
        )
        rows.append(row)
        print(f"{path.stem:40} {row[0]:6.2f} {row[1]:6.2f} | {row[2]:6.2f} {row[3]:9.2f} {row[4]:6.2f}")
    median = np.median(rows, 0)
    print(f"{'median':40} {median[0]:6.2f} {median[1]:6.2f} | {median[2]:6.2f} {median[3]:9.2f} {median[4]:6.2f}")


if __name__ == "__main__":
    main()
