// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Textures of OpenGL; see texture.h. Their levels are made here or by the canvas, never by
 * glGenerateMipmap(), which does the whole texture each time.
 */
#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include "texture.h"

#define LEVELS_MAX 15	/* a canvas has at most 16384 texels a side */
#define FILM_TEXELS 2.5 /* over which a film ends, at level 0 */
#define FILM_SLOPE 0.6

struct incise_texture {
	unsigned name;
	int size, levels;
	int reach[LEVELS_MAX][2];   /* to the texel whose wetness is compared */
	uint8_t *slope[LEVELS_MAX]; /* of the skin */
	uint8_t *band;		    /* what is sent: rows of one rectangle */
	size_t band_bytes;
};

static bool too_large(int size, struct incise_error *err)
{
	int most = 0;

	glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
	if (size <= most)
		return false;
	incise_error_set(err, ENOTSUP,
			 "picture: a texture of %d texels; the graphics have at most %d: "
			 "make picture.texture_px of the scene smaller",
			 size, most);
	return true;
}

static unsigned begin(int levels, bool fine)
{
	unsigned name;

	glGenTextures(1, &name);
	glBindTexture(GL_TEXTURE_2D, name);
	glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, levels - 1);
	glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
	glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
	glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
	glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER,
			fine ? GL_LINEAR_MIPMAP_LINEAR : GL_LINEAR_MIPMAP_NEAREST);
	if (fine && epoxy_has_gl_extension("GL_EXT_texture_filter_anisotropic")) {
		float most = 1;

		glGetFloatv(GL_MAX_TEXTURE_MAX_ANISOTROPY_EXT, &most);
		glTexParameterf(GL_TEXTURE_2D, GL_TEXTURE_MAX_ANISOTROPY_EXT,
				most < 8 ? most : 8);
	}
	return name;
}

static void slopes(uint8_t *to, const uint8_t *normal_rgb, size_t n, const double way[2])
{
	/* In 1/128 of the way. */
	int x = (int)lround(way[0] * 128), y = (int)lround(way[1] * 128);

	for (size_t i = 0; i < n; i++) {
		int lean = 0;

		if (normal_rgb)
			lean = ((normal_rgb[3 * i] - 128) * x +
				(normal_rgb[3 * i + 1] - 128) * y) /
			       128;
		to[i] = (uint8_t)(lean < -127 ? 1 : lean > 127 ? 255 : 128 + lean);
	}
}

/* The mean of 2 × 2: from afar a rough skin is smooth. */
static void halve(uint8_t *to, const uint8_t *from, int side)
{
	for (int y = 0; y < side; y++)
		for (int x = 0; x < side; x++) {
			const uint8_t *at = from + (size_t)4 * y * side + 2 * x;

			to[(size_t)y * side + x] =
				(uint8_t)((at[0] + at[1] + at[2 * side] +
					   at[2 * side + 1] + 2) /
					  4);
		}
}

static bool make_slopes(struct incise_texture *texture,
			const struct incise_texture_setup *setup)
{
	for (int level = 0; level < texture->levels; level++) {
		int side = texture->size >> level;
		double texels = fmax(FILM_TEXELS / (1 << level), 1);

		texture->slope[level] = malloc((size_t)side * side);
		if (!texture->slope[level])
			return false;
		if (level)
			halve(texture->slope[level], texture->slope[level - 1], side);
		else
			slopes(texture->slope[0], setup->normal_rgb, (size_t)side * side,
			       setup->way);
		for (int k = 0; k < 2; k++)
			texture->reach[level][k] = (int)lround(setup->way[k] * texels);
	}
	return true;
}

/*
 * How wet a texel is, 0 … 255, by its colour: fresh blood has green below a third of red,
 * skin, liver and what has dried have more. The shader has the same rule.
 */
static int wetness(const uint8_t *rgba)
{
	int wet = 3 * rgba[0] - 7 * rgba[1];

	return wet < 0 ? 0 : wet > 255 ? 255 : wet;
}

static int held(int x, int side)
{
	return x < 0 ? 0 : x >= side ? side - 1 : x;
}

static uint8_t lean(int slope, int wet, int next)
{
	int skin = (slope - 128) * (282 - wet) / 282;
	int film = (int)(FILM_SLOPE * 128) * (wet - next) / 256;

	return (uint8_t)(held(skin + film + 127, 255) + 1);
}

/* One rectangle, within its level: colours and slopes. */
static void fill(const struct incise_texture *texture, const uint8_t *pixels, int stride,
		 int level, const struct incise_rect *r)
{
	int side = texture->size >> level;
	const int *reach = texture->reach[level];
	uint8_t *to = texture->band;

	for (int y = r->y; y < r->y + r->h; y++) {
		const uint8_t *row = pixels + (size_t)y * stride;
		const uint8_t *next = pixels + (size_t)held(y + reach[1], side) * stride;
		const uint8_t *slope = texture->slope[level] + (size_t)y * side;

		for (int x = r->x; x < r->x + r->w; x++, to += 4) {
			const uint8_t *at = row + 4 * x;

			to[0] = at[0];
			to[1] = at[1];
			to[2] = at[2];
			to[3] = lean(slope[x], wetness(at),
				     wetness(next + 4 * held(x + reach[0], side)));
		}
	}
}

/* Rows at a time, so that a whole level needs little memory. */
static void send(const struct incise_texture *texture, const struct incise_canvas *canvas,
		 int level, struct incise_rect rect)
{
	int stride, bottom = rect.y + rect.h;
	const uint8_t *pixels = incise_canvas_pixels(canvas, level, &stride);
	int rows = (int)(texture->band_bytes / 4 / (size_t)rect.w);

	for (; rect.y < bottom; rect.y += rect.h) {
		rect.h = bottom - rect.y < rows ? bottom - rect.y : rows;
		fill(texture, pixels, stride, level, &rect);
		glTexSubImage2D(GL_TEXTURE_2D, level, rect.x, rect.y, rect.w, rect.h,
				GL_RGBA, GL_UNSIGNED_BYTE, texture->band);
	}
}

struct incise_texture *incise_texture_new(const struct incise_texture_setup *setup,
					  struct incise_error *err)
{
	struct incise_texture *texture;
	int size = incise_canvas_size(setup->canvas);

	if (too_large(size, err))
		return NULL;
	texture = calloc(1, sizeof(*texture));
	if (!texture)
		goto out_memory;
	texture->size = size;
	texture->levels = incise_canvas_levels(setup->canvas);
	/* 64 rows of the largest level. */
	texture->band_bytes = (size_t)size * 4 * 64;
	texture->band = malloc(texture->band_bytes);
	if (!texture->band || !make_slopes(texture, setup))
		goto out_memory;
	texture->name = begin(texture->levels, setup->fine);
	for (int level = 0; level < texture->levels; level++) {
		int side = size >> level;

		glTexImage2D(GL_TEXTURE_2D, level, GL_RGBA8, side, side, 0, GL_RGBA,
			     GL_UNSIGNED_BYTE, NULL);
		send(texture, setup->canvas, level,
		     (struct incise_rect){0, 0, side, side});
	}
	return texture;

out_memory:
	incise_texture_free(texture);
	incise_error_set(err, ENOMEM, "picture: no memory for a texture of %d texels",
			 size);
	return NULL;
}

void incise_texture_free(struct incise_texture *texture)
{
	if (!texture)
		return;
	if (texture->name)
		glDeleteTextures(1, &texture->name);
	for (int level = 0; level < texture->levels; level++)
		free(texture->slope[level]);
	free(texture->band);
	free(texture);
}

void incise_texture_upload(struct incise_texture *texture,
			   const struct incise_canvas *canvas,
			   const struct incise_upload *uploads, int n)
{
	glBindTexture(GL_TEXTURE_2D, texture->name);
	for (int i = 0; i < n; i++) {
		const struct incise_rect *r = &uploads[i].rect;
		int level = uploads[i].level, side, left, top, right, bottom;
		const int *reach;

		if (level < 0 || level >= texture->levels)
			continue;
		side = texture->size >> level;
		if (r->x < 0 || r->y < 0 || r->w < 1 || r->h < 1 || r->w > side - r->x ||
		    r->h > side - r->y)
			continue;
		/* Those whose slope is a matter of the wetness in there. */
		reach = texture->reach[level];
		left = held(r->x - (reach[0] > 0 ? reach[0] : 0), side);
		right = held(r->x + r->w - 1 - (reach[0] < 0 ? reach[0] : 0), side);
		top = held(r->y - (reach[1] > 0 ? reach[1] : 0), side);
		bottom = held(r->y + r->h - 1 - (reach[1] < 0 ? reach[1] : 0), side);
		send(texture, canvas, level,
		     (struct incise_rect){left, top, right - left + 1, bottom - top + 1});
	}
}

unsigned incise_texture_name(const struct incise_texture *texture)
{
	return texture->name;
}

int incise_texture_side(const struct incise_texture *texture)
{
	return texture->size;
}

unsigned incise_texture_image(unsigned image, const uint8_t *bgra, int w, int h)
{
	if (!image) {
		image = begin(1, false);
		glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
		glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
	}
	glBindTexture(GL_TEXTURE_2D, image);
	glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, w, h, 0, GL_BGRA,
		     GL_UNSIGNED_INT_8_8_8_8_REV, bgra);
	return image;
}
