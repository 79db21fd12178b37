"""PNG and SVG file of a figure, drawn once.

Matplotlib's preparation of each text, tick and line takes longer than the drawing itself.
"""

import io
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.backend_bases import GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager, get_font
from matplotlib.path import Path
from matplotlib.textpath import TextToPath
from matplotlib.transforms import Affine2D, IdentityTransform, TransformedBbox, TransformedPath

from jaxsat.core.once import latest

COMPRESSION = 3
"""zlib's level: PNG files a fifth larger than with the usual 6, in half of the time."""

INCHES_PER_METRE = 1 / 0.0254

POINTS_PER_INCH = 72
"""The unit of an SVG file; figures pass pixels to renderers."""


def png_and_svg(figure: Figure) -> tuple[bytes, bytes]:
    """Return the PNG and the SVG file of a figure, without a date."""
    with io.StringIO() as text:
        renderer = _PngAndSvgRenderer(figure, text)
        figure.draw(renderer)
        renderer.svg.finalize()
        pixels = np.asarray(renderer.pixels.buffer_rgba())
        return _png(pixels, figure.dpi), text.getvalue().encode()


def _png(pixels: np.ndarray, dpi: float | int) -> bytes:
    """Return a PNG file (ISO/IEC 15948) of RGBA colours (rows, columns, 4), a byte each.

    Its rows are not filtered. That suits charts, large areas of one colour: choosing a filter for
    each row, as Pillow does, takes longer than the compression, without smaller files.
    """
    rows, columns, _ = pixels.shape
    unfiltered = np.zeros((rows, 1 + 4 * columns), np.uint8)
    unfiltered[:, 1:] = pixels.reshape(rows, -1)
    density = round(dpi * INCHES_PER_METRE)
    chunks = (
        (b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 6, 0, 0, 0)),
        (b"pHYs", struct.pack(">IIB", density, density, 1)),
        (b"IDAT", zlib.compress(unfiltered.tobytes(), COMPRESSION)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in chunks
    )


@latest(64)
def _font_files(font: FontProperties) -> list[Any]:
    """Return the cached places of a font's file and of those for letters that it lacks."""
    manager: Any = fontManager
    return manager._find_fonts_by_props(font)


class _Outlines(TextToPath):
    """Outlines of lines of text, each set once: figures of a run share most of their texts.

    They depend on settings of matplotlib, which `save_figures` sets to the same values.
    """

    def __init__(self):
        super().__init__()
        self._known: dict[tuple[str, str, str], tuple[Any, Any, Any]] = {}

    def _get_font(self, prop: FontProperties) -> Any:
        """Return the font with its size set; matplotlib looks for its files each time."""
        font = get_font(_font_files(prop.copy()))
        font.set_size(self.FONT_SCALE, self.DPI)
        return font

    def get_glyphs_with_font(
        self, font, s, glyph_map=None, return_new_glyphs_only=False, **look
    ) -> tuple[Any, Any, Any]:
        """Return positions of glyphs, the glyphs (all, or those not in the map), and boxes."""
        key = (font.fname, s, repr([one for one in look.items() if one[1] is not None]))
        if key not in self._known:
            self._known[key] = super().get_glyphs_with_font(font, s, **look)
        places, glyphs, boxes = self._known[key]
        before = glyph_map or {}
        new = {name: glyph for name, glyph in glyphs.items() if name not in before}
        return places, new if return_new_glyphs_only else {**before, **new}, boxes


_OUTLINES = _Outlines()


@latest(4096)
def _outline(text: str, font: FontProperties, ismath: Any) -> Path:
    """Return the cached outline of a line of text, `_OUTLINES.FONT_SCALE` points high."""
    outlines: Any = _OUTLINES
    if ismath:
        vertices, kinds = outlines.get_text_path(font, text, ismath)
        return Path(vertices, kinds)
    places, glyphs, _ = outlines.get_glyphs_with_font(outlines._get_font(font), text)
    corners = [glyphs[name][0] * size + (x, y) for name, x, y, size in places]
    codes = [glyphs[name][1] for name, *_ in places]
    return Path(np.concatenate([np.empty((0, 2)), *corners]), np.concatenate([[], *codes]))


@latest(4096)
def _text_size(text: str, font: FontProperties, ismath: Any) -> tuple[float, float, float]:
    """Return cached width, height and descent of a line of text in points."""
    return _OUTLINES.get_text_width_height_descent(text, font, ismath)


def _by_each(name: str, *transformations: int) -> Any:
    """Return the method `name`, which each renderer performs in its own units.

    The arguments at the places `transformations`, counted after the graphics context, lead to
    pixels.
    """

    def draw(self, gc, *arguments, **more) -> None:
        for renderer, own, unit in self._each(gc):
            places = [x + unit if i in transformations else x for i, x in enumerate(arguments)]
            getattr(renderer, name)(own, *places, **more)

    return draw


class _PngAndSvgRenderer(RendererBase):
    """Renderer that draws to two others: in pixels for PNG, and in points for SVG.

    Texts are laid out for the PNG file. Content that matplotlib rasterises in SVG too, such as a
    mesh of many colours, becomes an image in the SVG file.
    """

    def __init__(self, figure: Figure, file: io.StringIO):
        super().__init__()
        self.width, self.height = figure.bbox.size
        self.dpi: Any = figure.dpi
        self.pixels = self._new_pixels()
        self._scale = POINTS_PER_INCH / self.dpi
        self._points = Affine2D().scale(self._scale)
        self._image: RendererAgg | None = None
        size = (self.width * self._scale, self.height * self._scale)
        self.svg = RendererSVG(*size, file, image_dpi=self.dpi, metadata={"Date": None})
        self.svg._text2path = _OUTLINES

    def _new_pixels(self) -> RendererAgg:
        return RendererAgg(self.width, self.height, self.dpi)

    def _each(self, gc: GraphicsContextBase) -> Iterator[tuple[Any, GraphicsContextBase, Any]]:
        """Yield the renderers with their graphics context and the transformation from pixels."""
        yield self.pixels, gc, IdentityTransform()
        if self._image is not None:
            yield self._image, gc, IdentityTransform()
        else:
            yield self.svg, self._in_points(gc), self._points

    def _in_points(self, gc: GraphicsContextBase) -> GraphicsContextBase:
        """Return a graphics context with `gc`'s clipping in points, as widths and dashes are."""
        clip: Any = gc.get_clip_path()
        box, (path, transform) = gc.get_clip_rectangle(), clip
        if box is None and path is None:
            return gc
        context: Any = self.svg.new_gc()
        context.copy_properties(gc)
        if box is not None:
            context.set_clip_rectangle(TransformedBbox(box, self._points))
        if path is not None:
            context.set_clip_path(TransformedPath(path, transform + self._points))
        return context

    draw_path = _by_each("draw_path", 1)
    draw_markers = _by_each("draw_markers", 1, 3)
    draw_path_collection = _by_each("draw_path_collection", 0, 4)
    draw_quad_mesh = _by_each("draw_quad_mesh", 0, 5)
    draw_gouraud_triangles = _by_each("draw_gouraud_triangles", 2)

    def draw_image(self, gc, x, y, im, transform=None) -> None:
        """Draw an image of pixels, whose lower left corner is at x and y."""
        del transform  # for renderers that scale images
        for renderer, own, unit in self._each(gc):
            renderer.draw_image(own, *unit.transform((x, y)), im)

    def draw_text(self, gc, x, y, s, prop, angle, ismath=False, mtext=None) -> None:
        """Draw one line of text, as outlines in both files.

        Matplotlib lays each text out once more for pixels, and draws it letter by letter, which
        takes ten times as long.
        """
        for renderer, own, unit in self._each(gc):
            if renderer is self.svg:
                renderer.draw_text(own, *unit.transform((x, y)), s, prop, angle, ismath, mtext)
                continue
            filled = renderer.new_gc()
            filled.copy_properties(gc)
            filled.set_linewidth(0)
            size = prop.get_size_in_points() / self._scale / _OUTLINES.FONT_SCALE
            turned = Affine2D().scale(size).rotate_deg(angle)
            place = turned.translate(round(x), round(self.height - y))
            renderer.draw_path(filled, _outline(s, prop.copy(), ismath), place, gc.get_rgb())

    def open_group(self, s, gid=None) -> None:
        """Begin a group of the SVG file."""
        if self._image is None:
            self.svg.open_group(s, gid)

    def close_group(self, s) -> None:
        """End a group of the SVG file."""
        if self._image is None:
            self.svg.close_group(s)

    def start_rasterizing(self) -> None:
        """Begin content that becomes an image in the SVG file."""
        self._image = self._new_pixels()

    def stop_rasterizing(self) -> None:
        """Write the image, cropped to its content."""
        image: Any = self._image
        self._image = None
        pixels = np.asarray(image.buffer_rgba())
        rows, columns = (np.flatnonzero(pixels[..., 3].any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return
        part = pixels[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        corner = (columns[0] * self._scale, (self.height - rows[-1] - 1) * self._scale)
        self.svg.draw_image(self.svg.new_gc(), *corner, part[::-1])

    def flipy(self) -> bool:
        """Whether y points down, as in both formats."""
        return True

    def get_canvas_width_height(self) -> tuple[float, float]:
        """Return the size in pixels."""
        return self.width, self.height

    def get_text_width_height_descent(self, s, prop, ismath) -> tuple[float, float, float]:
        """Return the size of a line of text in pixels."""
        width, height, descent = _text_size(s, prop.copy(), ismath)
        return width / self._scale, height / self._scale, descent / self._scale

    def points_to_pixels(self, points: Any) -> Any:
        """Convert a length to pixels."""
        return self.pixels.points_to_pixels(points)
