// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Drawing by OpenGL; see draw.h: triangles, the framebuffer, the textures, the scene.
 */
#include <dlfcn.h>
#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "draw.h"
#include "instrument_shape.h"
#include "shaders.h"
#include "view_camera.h"

/*
 * Triangles in the graphics' memory, for the shaders: attribute 0 is the place in mm, 1 the
 * normal, 2 the tangent or the colour, 3 the texel.
 */
struct solid {
	unsigned array, vertices, indices; /* OpenGL's names */
	int n_indices;
};

static void attribute(int index, int n, size_t stride, size_t offset)
{
	glEnableVertexAttribArray(index);
	glVertexAttribPointer(index, n, GL_FLOAT, GL_FALSE, (int)stride,
			      (const void *)(uintptr_t)offset);
}

static void fill_buffers(struct solid *solid, const void *vertices, size_t bytes,
			 const uint32_t *indices, int n_indices)
{
	glGenVertexArrays(1, &solid->array);
	glGenBuffers(1, &solid->vertices);
	glGenBuffers(1, &solid->indices);
	glBindVertexArray(solid->array);
	glBindBuffer(GL_ARRAY_BUFFER, solid->vertices);
	glBufferData(GL_ARRAY_BUFFER, (GLsizeiptr)bytes, vertices, GL_STATIC_DRAW);
	glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, solid->indices);
	glBufferData(GL_ELEMENT_ARRAY_BUFFER, (GLsizeiptr)n_indices * 4, indices,
		     GL_STATIC_DRAW);
	solid->n_indices = n_indices;
}

static void solid_draw(const struct solid *solid)
{
	glBindVertexArray(solid->array);
	glDrawElements(GL_TRIANGLES, solid->n_indices, GL_UNSIGNED_INT, NULL);
}

static void solid_free(struct solid *solid)
{
	glDeleteVertexArrays(1, &solid->array);
	glDeleteBuffers(1, &solid->vertices);
	glDeleteBuffers(1, &solid->indices);
}

static void solid_surface(struct solid *solid, const struct uv_map *map,
			  double middle_mm[3], double *reach_mm)
{
	const size_t stride = sizeof(struct uv_map_vertex);
	double low[3] = {INFINITY, INFINITY, INFINITY};
	double high[3] = {-INFINITY, -INFINITY, -INFINITY}, across[3];

	fill_buffers(solid, map->vertices, map->n_vertices * stride, map->indices,
		     map->n_indices);
	attribute(0, 3, stride, offsetof(struct uv_map_vertex, position_mm));
	attribute(1, 3, stride, offsetof(struct uv_map_vertex, normal));
	attribute(2, 4, stride, offsetof(struct uv_map_vertex, tangent));
	attribute(3, 2, stride, offsetof(struct uv_map_vertex, px));
	for (int i = 0; i < map->n_vertices; i++)
		for (int k = 0; k < 3; k++) {
			low[k] = fmin(low[k], map->vertices[i].position_mm[k]);
			high[k] = fmax(high[k], map->vertices[i].position_mm[k]);
		}
	for (int k = 0; k < 3 && map->n_vertices > 0; k++)
		middle_mm[k] = 0.5 * (low[k] + high[k]);
	v3_sub(across, high, low);
	*reach_mm = map->n_vertices > 0 ? 0.5 * v3_length(across) : 1;
}

static void solid_instrument(struct solid *solid, const struct instrument_mesh *mesh)
{
	const size_t stride = sizeof(struct instrument_vertex);

	fill_buffers(solid, mesh->vertices, mesh->n_vertices * stride, mesh->indices,
		     mesh->n_indices);
	attribute(0, 3, stride, offsetof(struct instrument_vertex, position_mm));
	attribute(1, 3, stride, offsetof(struct instrument_vertex, normal));
	attribute(2, 4, stride, offsetof(struct instrument_vertex, rgb));
}

/*
 * The target: a framebuffer object with several samples per pixel and depth, and the object of
 * single pixels to which it is resolved.
 */
struct target {
	int width, height;
	int samples;	 /* 1: drawn on single pixels at once */
	unsigned drawn;	 /* framebuffer of the scene */
	unsigned single; /* framebuffer of single pixels; the same with one sample */
	unsigned colour, depth, pixels; /* renderbuffers */
};

static void target_free(struct target *target)
{
	if (target->single != target->drawn)
		glDeleteFramebuffers(1, &target->single);
	glDeleteFramebuffers(1, &target->drawn);
	glDeleteRenderbuffers(1, &target->colour);
	glDeleteRenderbuffers(1, &target->depth);
	glDeleteRenderbuffers(1, &target->pixels);
	target->drawn = target->single = 0;
	target->colour = target->depth = target->pixels = 0;
}

static unsigned make_renderbuffer(const struct target *target, int samples, GLenum format)
{
	unsigned name;

	glGenRenderbuffers(1, &name);
	glBindRenderbuffer(GL_RENDERBUFFER, name);
	glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples > 1 ? samples : 0,
					 format, target->width, target->height);
	return name;
}

static unsigned make_framebuffer(unsigned colour, unsigned depth)
{
	unsigned name;

	glGenFramebuffers(1, &name);
	glBindFramebuffer(GL_FRAMEBUFFER, name);
	glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER,
				  colour);
	if (depth)
		glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT,
					  GL_RENDERBUFFER, depth);
	return name;
}

static int complete_draw(struct target *target)
{
	int good;

	target->colour = make_renderbuffer(target, target->samples, GL_RGBA8);
	target->depth = make_renderbuffer(target, target->samples, GL_DEPTH_COMPONENT24);
	target->drawn = make_framebuffer(target->colour, target->depth);
	good = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
	target->single = target->drawn;
	if (target->samples > 1) {
		target->pixels = make_renderbuffer(target, 1, GL_RGBA8);
		target->single = make_framebuffer(target->pixels, 0);
		good &= glCheckFramebufferStatus(GL_FRAMEBUFFER) ==
			GL_FRAMEBUFFER_COMPLETE;
	}
	return good && glGetError() == GL_NO_ERROR;
}

static int target_size(struct target *target, int width, int height,
		       struct incise_error *err)
{
	int side_max = 0, samples_max = 1, samples = target->samples;

	if (target->drawn && target->width == width && target->height == height)
		return 0;
	glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &side_max);
	glGetIntegerv(GL_MAX_SAMPLES, &samples_max);
	if (width < 1 || height < 1 || width > side_max || height > side_max)
		return incise_error_set(err, EINVAL,
					"image: %d × %d pixels; expected 1 to %d each",
					width, height, side_max);
	target_free(target);
	target->width = width;
	target->height = height;
	target->samples = samples < samples_max ? samples : samples_max;
	while (!complete_draw(target)) {
		samples = target->samples / 2;
		target_free(target);
		if (samples < 1) {
			target->width = target->height = 0;
			return incise_error_set(
				err, ENOTSUP,
				"image: no framebuffer of %d × %d pixels; try a "
				"smaller image",
				width, height);
		}
		target->samples = samples;
	}
	return 0;
}

static void target_resolve(const struct target *target)
{
	if (target->samples > 1) {
		glBindFramebuffer(GL_READ_FRAMEBUFFER, target->drawn);
		glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target->single);
		glBlitFramebuffer(0, 0, target->width, target->height, 0, 0,
				  target->width, target->height, GL_COLOR_BUFFER_BIT,
				  GL_NEAREST);
	}
	glBindFramebuffer(GL_FRAMEBUFFER, target->single);
}

/*
 * Textures: the surface's, which is sent by rectangles, and images over the frame. Their levels
 * are made here or by the canvas, never by glGenerateMipmap(), which does the whole texture.
 *
 * The surface has a single texture, since each lookup costs a CPU renderer a quarter of its frame:
 * red, green and blue are the canvas's; alpha is the skin's slope towards the lamp, 128 + 127 times
 * the slope along @way, as lamp and surface stand still. It comes from the skin's normals, and for
 * wet blood from the border of its film:
 *
 *          wet            next, some texels along the way to the lamp
 *     ▁▁▁▂▅▇▇▇▇▇▇▅▂▁▁▁    slope = a share of (wet - next)
 *        ▲       ▲
 *     leans     leans
 *     away      to the lamp
 */
#define LEVELS_MAX 15	/* a canvas has at most 16384 texels a side */
#define FILM_TEXELS 2.5 /* width of a film's border, at level 0 */
#define FILM_SLOPE 0.6

struct texture {
	unsigned name;
	int size, levels;
	int reach[LEVELS_MAX][2];   /* to the texel for the comparison of wetness */
	uint8_t *slope[LEVELS_MAX]; /* of the skin */
	uint8_t *band;		    /* rows of one rectangle, to be sent */
	size_t band_bytes;
};

static void texture_free(struct texture *texture)
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

static bool too_large(int size, struct incise_error *err)
{
	int most = 0;

	glGetIntegerv(GL_MAX_TEXTURE_SIZE, &most);
	if (size <= most)
		return false;
	incise_error_set(err, ENOTSUP,
			 "image: a texture of %d texels, but the graphics allow %d; "
			 "reduce picture.texture_px of the scene",
			 size, most);
	return true;
}

static unsigned begin_texture(int levels, bool fine)
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
	/* In 1/128. */
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

/* The mean of 2 × 2: from a distance rough skin is smooth. */
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

static bool make_slopes(struct texture *texture, const uint8_t *normal_rgb,
			const double way[2])
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
			slopes(texture->slope[0], normal_rgb, (size_t)side * side, way);
		for (int k = 0; k < 2; k++)
			texture->reach[level][k] = (int)lround(way[k] * texels);
	}
	return true;
}

/*
 * The wetness of a texel, 0 … 255, by its colour: fresh blood has green below a third of red; skin,
 * liver and dried blood have more. The shader has the same rule.
 */
static inline int wetness(uint32_t texel)
{
	/* Red is its first byte. */
	int wet = 3 * (int)(texel & 0xff) - 7 * (int)(texel >> 8 & 0xff);

	return wet < 0 ? 0 : wet > 255 ? 255 : wet;
}

static int clamp_index(int x, int side)
{
	return x < 0 ? 0 : x >= side ? side - 1 : x;
}

/* A texel with the lean in its alpha; @next: the texel to compare its wetness with. */
static inline uint32_t leaning(uint32_t texel, uint32_t next, uint8_t slope)
{
	int wet = wetness(texel), step = wet - wetness(next);
	/* 282 is more than the wettest; 465 / 2^17 is 1 / 282. */
	int skin = ((slope - 128) * (282 - wet) * 465) >> 17;
	int lean = skin + (((int)(FILM_SLOPE * 128) * step) >> 8) + 128;

	lean = lean < 1 ? 1 : lean > 255 ? 255 : lean;
	return (texel & 0xffffff) | (uint32_t)lean << 24;
}

/* Texels of a row, some at a time in a form that compilers vectorize. */
#define BLOCK 16

static void fill_row(uint8_t *to, const uint8_t *row, const uint8_t *next,
		     const uint8_t *slope, int n)
{
	uint32_t texel[BLOCK], beside[BLOCK];

	for (; n >= BLOCK; n -= BLOCK, slope += BLOCK) {
		memcpy(texel, row, sizeof(texel));
		memcpy(beside, next, sizeof(beside));
		for (int i = 0; i < BLOCK; i++)
			texel[i] = leaning(texel[i], beside[i], slope[i]);
		memcpy(to, texel, sizeof(texel));
		to += sizeof(texel);
		row += sizeof(texel);
		next += sizeof(texel);
	}
	for (int i = 0; i < n; i++) {
		memcpy(texel, row + 4 * i, 4);
		memcpy(beside, next + 4 * i, 4);
		texel[0] = leaning(texel[0], beside[0], slope[i]);
		memcpy(to + 4 * i, texel, 4);
	}
}

/* One rectangle, within its level: colours and slopes. */
static void fill_band(const struct texture *texture, const uint8_t *pixels, int stride,
		      int level, const struct incise_rect *r)
{
	int side = texture->size >> level;
	const int *reach = texture->reach[level];
	/* Texels whose neighbour is within the row. */
	int first = clamp_index(-reach[0], r->x + r->w), end = side - reach[0];
	uint8_t *to = texture->band;

	first = first > r->x ? first : r->x;
	end = end < r->x + r->w ? end : r->x + r->w;
	for (int y = r->y; y < r->y + r->h; y++, to += 4 * (size_t)r->w) {
		const uint8_t *row = pixels + (size_t)y * stride;
		const uint8_t *next =
			pixels + (size_t)clamp_index(y + reach[1], side) * stride;
		const uint8_t *slope = texture->slope[level] + (size_t)y * side;

		for (int x = r->x; x < r->x + r->w; x++) {
			int n = x == first && end > first ? end - first : 1;
			int beside = clamp_index(x + reach[0], side);

			fill_row(to + 4 * (x - r->x), row + 4 * x, next + 4 * beside,
				 slope + x, n);
			x += n - 1;
		}
	}
}

/* Send some rows at a time, so that a whole level needs little memory. */
static void send_rect(const struct texture *texture, const struct incise_canvas *canvas,
		      int level, struct incise_rect rect)
{
	int stride, bottom = rect.y + rect.h;
	const uint8_t *pixels = incise_canvas_pixels(canvas, level, &stride);
	int rows = (int)(texture->band_bytes / 4 / (size_t)rect.w);

	for (; rect.y < bottom; rect.y += rect.h) {
		rect.h = bottom - rect.y < rows ? bottom - rect.y : rows;
		fill_band(texture, pixels, stride, level, &rect);
		glTexSubImage2D(GL_TEXTURE_2D, level, rect.x, rect.y, rect.w, rect.h,
				GL_RGBA, GL_UNSIGNED_BYTE, texture->band);
	}
}

/* @way: unit, to the lamp, in texels right and down. @fine: with expensive filters. */
static struct texture *texture_new(const struct incise_draw_setup *setup,
				   const double way[2], bool fine,
				   struct incise_error *err)
{
	struct texture *texture;
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
	if (!texture->band || !make_slopes(texture, setup->normal_rgb, way))
		goto out_memory;
	texture->name = begin_texture(texture->levels, fine);
	for (int level = 0; level < texture->levels; level++) {
		int side = size >> level;

		glTexImage2D(GL_TEXTURE_2D, level, GL_RGBA8, side, side, 0, GL_RGBA,
			     GL_UNSIGNED_BYTE, NULL);
		send_rect(texture, setup->canvas, level,
			  (struct incise_rect){0, 0, side, side});
	}
	return texture;

out_memory:
	texture_free(texture);
	return INCISE_ERROR_NULL(err, ENOMEM,
				 "image: no memory for a texture of %d texels", size);
}

static unsigned texture_image(unsigned image, const uint8_t *bgra, int w, int h)
{
	if (!image) {
		image = begin_texture(1, false);
		glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
		glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
	}
	glBindTexture(GL_TEXTURE_2D, image);
	glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, w, h, 0, GL_BGRA,
		     GL_UNSIGNED_INT_8_8_8_8_REV, bgra);
	return image;
}

/* --- The scene --- */

#define DRAW_SLOTS 4

static const double draw_key_way[3] = UV_MAP_LAMP;

struct incise_draw {
	struct solid surface, scalpel, tube;
	unsigned program[SHADERS];
	struct texture *texture;
	double way[2]; /* to the lamp, in texels */
	struct {
		unsigned texture;
		uint64_t version;
		int w, h;
	} slot[DRAW_SLOTS];
	unsigned nothing; /* array without attributes */
	struct target target;
	struct incise_scene_scalpel tool;
	enum incise_skin look;
	struct incise_draw_info info;
	bool drawn;
};

static int failed_draw(struct incise_error *err)
{
	GLenum why = glGetError();

	/* Clear all errors; a lost context may repeat its own. */
	for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; i++)
		;
	if (why == GL_NO_ERROR)
		return 0;
	if (why == GL_OUT_OF_MEMORY)
		return incise_error_set(err, ENOMEM, "image: no memory for graphics");
	return incise_error_set(
		err, EIO, "image: the graphics failed (OpenGL 0x%x); start again", why);
}

static int put_instruments(struct incise_draw *draw, struct incise_error *err)
{
	struct instrument_mesh mesh;
	int rc = instrument_scalpel(&draw->tool, &mesh);

	if (!rc) {
		solid_instrument(&draw->scalpel, &mesh);
		instrument_free(&mesh);
		rc = instrument_tube(draw->tool.tube_mm, &mesh);
	}
	if (rc)
		return incise_error_set(err, -rc, "image: no memory");
	solid_instrument(&draw->tube, &mesh);
	instrument_free(&mesh);
	return 0;
}

static int put_programs(struct incise_draw *draw, struct incise_error *err)
{
	for (int i = 0; i < SHADERS; i++) {
		draw->program[i] = shader_program((enum shader)i, err);
		if (!draw->program[i])
			return -EIO;
	}
	return 0;
}

/* A CPU renderer does without expensive effects. */
static bool by_cpu(const char *name)
{
	return strstr(name, "llvmpipe") || strstr(name, "softpipe");
}

/* libepoxy ends the process when it finds neither. */
static bool has_library(struct incise_error *err)
{
	static const char *const names[] = {"libOpenGL.so.0", "libGL.so.1"};

	for (int i = 0; i < 2; i++)
		if (dlopen(names[i], RTLD_LAZY))
			return true;
	incise_error_set(err, ENOTSUP,
			 "image: no libOpenGL.so.0 and no libGL.so.1; install libgl1");
	return false;
}

/* The direction of the lamp from the middle of the texture, without its height. */
static void find_way(struct incise_draw *draw, const struct uv_map *map)
{
	double middle[2] = {map->size / 2.0, map->size / 2.0};
	double right[3], down[3], length;

	uv_map_metric(map, middle, right, down);
	draw->way[0] = v3_unit(right, right, 0) ? v3_dot(right, draw_key_way) : -1;
	draw->way[1] = v3_unit(down, down, 0) ? v3_dot(down, draw_key_way) : 0;
	length = hypot(draw->way[0], draw->way[1]);
	for (int k = 0; k < 2; k++)
		draw->way[k] = length > 1e-6 ? draw->way[k] / length : 1 - k;
}

struct incise_draw *incise_draw_new(const struct incise_draw_setup *setup,
				    struct incise_error *err)
{
	struct incise_draw *draw;
	bool fine;

	if (!has_library(err))
		return NULL;
	draw = calloc(1, sizeof(*draw));
	if (!draw)
		return INCISE_ERROR_NULL(err, ENOMEM, "image: no memory");
	if (epoxy_gl_version() < 33) {
		incise_error_set(err, ENOTSUP,
				 "image: OpenGL %d.%d, but 3.3 is required; install "
				 "libgl1-mesa-dri, or run with LIBGL_ALWAYS_SOFTWARE=1",
				 epoxy_gl_version() / 10, epoxy_gl_version() % 10);
		goto out_free;
	}
	snprintf(draw->info.renderer, sizeof(draw->info.renderer), "%s",
		 (const char *)glGetString(GL_RENDERER));
	fine = !by_cpu(draw->info.renderer);
	draw->tool = setup->scalpel;
	draw->look = setup->look;
	draw->target.samples = setup->samples > 0 ? setup->samples : fine ? 4 : 1;
	glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
	glPixelStorei(GL_PACK_ALIGNMENT, 1);
	glGenVertexArrays(1, &draw->nothing);
	solid_surface(&draw->surface, setup->map, draw->info.middle_mm,
		      &draw->info.reach_mm);
	if (put_instruments(draw, err) || put_programs(draw, err))
		goto out_free;
	find_way(draw, setup->map);
	draw->texture = texture_new(setup, draw->way, fine, err);
	if (!draw->texture || failed_draw(err))
		goto out_free;
	return draw;

out_free:
	incise_draw_free(draw);
	return NULL;
}

void incise_draw_free(struct incise_draw *draw)
{
	if (!draw)
		return;
	if (draw->nothing) {
		solid_free(&draw->surface);
		solid_free(&draw->scalpel);
		solid_free(&draw->tube);
		glDeleteVertexArrays(1, &draw->nothing);
		for (int i = 0; i < SHADERS; i++)
			glDeleteProgram(draw->program[i]);
		texture_free(draw->texture);
		for (int i = 0; i < DRAW_SLOTS; i++)
			glDeleteTextures(1, &draw->slot[i].texture);
		target_free(&draw->target);
	}
	free(draw);
}

void incise_draw_upload(struct incise_draw *draw, const struct incise_canvas *canvas,
			const struct incise_upload *uploads, int n)
{
	const struct texture *texture = draw->texture;

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
		/* Include texels whose slope depends on the wetness in the rectangle. */
		reach = texture->reach[level];
		left = clamp_index(r->x - (reach[0] > 0 ? reach[0] : 0), side);
		right = clamp_index(r->x + r->w - 1 - (reach[0] < 0 ? reach[0] : 0),
				    side);
		top = clamp_index(r->y - (reach[1] > 0 ? reach[1] : 0), side);
		bottom = clamp_index(r->y + r->h - 1 - (reach[1] < 0 ? reach[1] : 0),
				     side);
		send_rect(texture, canvas, level,
			  (struct incise_rect){left, top, right - left + 1,
					       bottom - top + 1});
	}
}

static int uniform(const struct incise_draw *draw, enum shader shader, const char *name)
{
	return glGetUniformLocation(draw->program[shader], name);
}

static void set_vector(int to, const double v[3])
{
	glUniform3f(to, (float)v[0], (float)v[1], (float)v[2]);
}

static void use_program(const struct incise_draw *draw, enum shader shader,
			const struct view_projection *projection)
{
	static const double sky[3] = {0, 0, 1};
	double key[3];

	v3_unit(key, draw_key_way, 0);
	glUseProgram(draw->program[shader]);
	glUniformMatrix4fv(uniform(draw, shader, "clip"), 1, GL_FALSE, projection->clip);
	set_vector(uniform(draw, shader, "camera"), projection->position_mm);
	set_vector(uniform(draw, shader, "key"), key);
	set_vector(uniform(draw, shader, "sky"), sky);
}

static void caster_end(float to[4], const struct instrument_place *place,
		       const double at[3])
{
	for (int k = 0; k < 3; k++)
		to[k] = (float)(place->origin_mm[k] + at[0] * place->x[k] +
				at[1] * place->z[k]);
	to[3] = (float)at[2];
}

/* Lines with a thickness that represent the instrument where it casts a shadow. */
static void set_casters(const struct incise_draw *draw,
			const struct instrument_place *place)
{
	double h = draw->tool.handle_mm;
	/* Along x and z, and radius: blade, handle; a tube, its flange, its connector. */
	const double scalpel[][3] = {
		{0, 0, 0.3}, {0.2, fmin(28, h / 4), 2.2}, {0, h, 3.2}};
	const double tube[][3] = {{0, 0, draw->tool.tube_mm / 2},
				  {0, INSTRUMENT_FLANGE_MM - 1, draw->tool.tube_mm / 2},
				  {0, INSTRUMENT_FLANGE_MM + 1, 12},
				  {0, INSTRUMENT_FLANGE_MM + 24, 7.5}};
	const double(*line)[3] = place && place->tube ? tube : scalpel;
	int n = !place ? 0 : place->tube ? 3 : 2;
	float from[SHADERS_CASTERS][4], to[SHADERS_CASTERS][4];

	glUniform1i(uniform(draw, SHADER_SURFACE, "casters"), n);
	for (int i = 0; i < n; i++) {
		caster_end(from[i], place, line[i]);
		caster_end(to[i], place, line[i + 1]);
	}
	if (n) {
		glUniform4fv(uniform(draw, SHADER_SURFACE, "from"), n, from[0]);
		glUniform4fv(uniform(draw, SHADER_SURFACE, "to"), n, to[0]);
	}
}

/*
 * The dent under an instrument that presses: skin gives way more to a blunt one.
 *
 *      ───╮  ║  ╭───
 *          ╲ ║ ╱   depth most_mm (1 - exp(-depth / soft_mm)), reach radius_mm
 *           ╰╨╯
 */
static void set_dent(const struct incise_draw *draw, const struct incise_tick *pose)
{
	static const struct {
		double most_mm, soft_mm, radius_mm;
	} dents[] = {
		[INCISE_TOOL_BLADE] = {0.8, 2, 3.5},
		[INCISE_TOOL_HANDLE] = {2.2, 4, 8},
		[INCISE_TOOL_TUBE] = {2.0, 5, 7.5},
	};
	double depth_mm = 0;
	int tool = INCISE_TOOL_BLADE;
	float at[4] = {0, 0, 0, 1};

	if (pose && (pose->flags & INCISE_TICK_CONTACT) && pose->depth_mm > 0 &&
	    pose->tool >= INCISE_TOOL_BLADE && pose->tool <= INCISE_TOOL_TUBE) {
		tool = (int)pose->tool;
		depth_mm = dents[tool].most_mm *
			   (1 - exp(-pose->depth_mm / dents[tool].soft_mm));
		for (int k = 0; k < 3; k++)
			at[k] = (float)pose->proxy_mm[k];
		at[3] = (float)dents[tool].radius_mm;
	}
	glUniform4fv(uniform(draw, SHADER_SURFACE, "dent"), 1, at);
	glUniform1f(uniform(draw, SHADER_SURFACE, "dent_mm"), (float)depth_mm);
}

static void draw_surface(struct incise_draw *draw,
			 const struct view_projection *projection,
			 const struct instrument_place *place,
			 const struct incise_tick *pose)
{
	use_program(draw, SHADER_SURFACE, projection);
	set_casters(draw, place);
	set_dent(draw, pose);
	glUniform1f(uniform(draw, SHADER_SURFACE, "texel"),
		    1.0f / (float)draw->texture->size);
	/* In parts of the texture's side; -1: no drape. */
	glUniform1f(uniform(draw, SHADER_SURFACE, "cloth"),
		    draw->look == INCISE_SKIN_NECK ? 0.055f : -1.0f);
	glUniform1f(uniform(draw, SHADER_SURFACE, "moist"),
		    draw->look == INCISE_SKIN_LIVER ? 0.6f : 0.0f);
	glUniform2f(uniform(draw, SHADER_SURFACE, "way"), (float)draw->way[0],
		    (float)draw->way[1]);
	glUniform1i(uniform(draw, SHADER_SURFACE, "base"), 0);
	glActiveTexture(GL_TEXTURE0);
	glBindTexture(GL_TEXTURE_2D, draw->texture->name);
	solid_draw(&draw->surface);
}

static void draw_instrument(struct incise_draw *draw,
			    const struct view_projection *projection,
			    const struct instrument_place *place)
{
	float matrix[16] = {0};

	for (int k = 0; k < 3; k++) {
		matrix[k] = (float)place->x[k];
		matrix[4 + k] = (float)place->y[k];
		matrix[8 + k] = (float)place->z[k];
		matrix[12 + k] = (float)place->origin_mm[k];
	}
	matrix[15] = 1;
	use_program(draw, SHADER_INSTRUMENT, projection);
	glUniformMatrix4fv(glGetUniformLocation(draw->program[SHADER_INSTRUMENT],
						"place"),
			   1, GL_FALSE, matrix);
	solid_draw(place->tube ? &draw->tube : &draw->scalpel);
}

int incise_draw_frame(struct incise_draw *draw, const struct incise_view_camera *camera,
		      const struct incise_tick *pose, int width, int height,
		      struct incise_error *err)
{
	struct incise_view_camera held = *camera;
	struct view_projection projection;
	struct instrument_place place;
	double off[3];
	bool placed = pose && instrument_place(&draw->tool, pose, &place);
	int rc;

	if (!view_camera_limit(&held))
		return incise_error_set(err, EINVAL, "image: the camera has no position");
	rc = target_size(&draw->target, width, height, err);
	if (rc)
		return rc;
	v3_sub(off, draw->info.middle_mm, held.target_mm);
	view_camera_project(&held, width, height,
			    v3_length(off) + draw->info.reach_mm + draw->tool.handle_mm +
				    100,
			    &projection);

	glBindFramebuffer(GL_FRAMEBUFFER, draw->target.drawn);
	glViewport(0, 0, width, height);
	glDisable(GL_BLEND);
	glEnable(GL_DEPTH_TEST);
	glEnable(GL_CULL_FACE);
	glDepthFunc(GL_LEQUAL);
	glDepthMask(GL_TRUE);
	glClear(GL_DEPTH_BUFFER_BIT);
	if (placed)
		draw_instrument(draw, &projection, &place);
	draw_surface(draw, &projection, placed ? &place : NULL, placed ? pose : NULL);
	/* The background last, where nothing else is. */
	glUseProgram(draw->program[SHADER_GROUND]);
	glBindVertexArray(draw->nothing);
	glDrawArrays(GL_TRIANGLES, 0, 3);
	target_resolve(&draw->target);
	draw->drawn = true;
	return failed_draw(err);
}

int incise_draw_overlay(struct incise_draw *draw, int slot, const uint8_t *bgra, int w,
			int h, uint64_t version, int x, int y)
{
	int width = draw->target.width, height = draw->target.height;

	if (slot < 0 || slot >= DRAW_SLOTS || w < 1 || h < 1 || !draw->drawn)
		return -EINVAL;
	glActiveTexture(GL_TEXTURE0);
	if (!draw->slot[slot].texture || draw->slot[slot].version != version ||
	    draw->slot[slot].w != w || draw->slot[slot].h != h) {
		draw->slot[slot].texture =
			texture_image(draw->slot[slot].texture, bgra, w, h);
		draw->slot[slot].version = version;
		draw->slot[slot].w = w;
		draw->slot[slot].h = h;
	}
	glBindTexture(GL_TEXTURE_2D, draw->slot[slot].texture);
	glDisable(GL_DEPTH_TEST);
	glDisable(GL_CULL_FACE);
	glEnable(GL_BLEND);
	glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
	glUseProgram(draw->program[SHADER_IMAGE]);
	glUniform1i(uniform(draw, SHADER_IMAGE, "image"), 0);
	glUniform4f(uniform(draw, SHADER_IMAGE, "box"), (float)(2.0 * x / width - 1),
		    (float)(1 - 2.0 * y / height), (float)(2.0 * (x + w) / width - 1),
		    (float)(1 - 2.0 * (y + h) / height));
	glBindVertexArray(draw->nothing);
	glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
	return failed_draw(NULL);
}

int incise_draw_read(struct incise_draw *draw, uint8_t *rgb, int width, int height)
{
	size_t row = (size_t)width * 3;

	if (!draw->drawn || width != draw->target.width || height != draw->target.height)
		return -EINVAL;
	glBindFramebuffer(GL_FRAMEBUFFER, draw->target.single);
	glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, rgb);
	/* OpenGL's rows start at the bottom. */
	for (int y = 0; y < height / 2; y++) {
		uint8_t *a = rgb + y * row, *b = rgb + (height - 1 - y) * row;

		for (size_t i = 0; i < row; i++) {
			uint8_t keep = a[i];

			a[i] = b[i];
			b[i] = keep;
		}
	}
	return failed_draw(NULL);
}

void incise_draw_show(struct incise_draw *draw)
{
	const struct target *target = &draw->target;

	if (!draw->drawn)
		return;
	glBindFramebuffer(GL_READ_FRAMEBUFFER, target->single);
	glBindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
	glBlitFramebuffer(0, 0, target->width, target->height, 0, 0, target->width,
			  target->height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
}

void incise_draw_finish(struct incise_draw *draw)
{
	if (draw->drawn)
		glFinish();
}

const struct incise_draw_info *incise_draw_info(struct incise_draw *draw)
{
	draw->info.samples = draw->target.samples;
	return &draw->info;
}
