// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A picture by OpenGL; see draw.h.
 */
#include <dlfcn.h>
#include <epoxy/gl.h>
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../base/vector.h"
#include "draw_parts.h"
#include "shaders.h"

static int failed(struct incise_error *err)
{
	GLenum why = glGetError();

	/* Those that came before this call count as well; a lost context may repeat its. */
	for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; i++)
		;
	if (why == GL_NO_ERROR)
		return 0;
	if (why == GL_OUT_OF_MEMORY)
		return incise_error_set(err, ENOMEM, "picture: no memory for graphics");
	return incise_error_set(
		err, EIO, "picture: the graphics failed (OpenGL 0x%x): start again", why);
}

static int put_instruments(struct incise_draw *draw, struct incise_error *err)
{
	struct incise_instrument_mesh mesh;
	int rc = incise_instrument_scalpel(draw->tool.handle_mm, &mesh);

	if (!rc) {
		incise_solid_instrument(&draw->scalpel, &mesh);
		incise_instrument_free(&mesh);
		rc = incise_instrument_tube(&mesh);
	}
	if (rc)
		return incise_error_set(err, -rc, "picture: no memory");
	incise_solid_instrument(&draw->tube, &mesh);
	incise_instrument_free(&mesh);
	return 0;
}

static int put_programs(struct incise_draw *draw, struct incise_error *err)
{
	draw->skin = incise_shader_program("skin", incise_shader_surface_vs,
					   incise_shader_surface_fs, err);
	if (draw->skin)
		draw->metal =
			incise_shader_program("instrument", incise_shader_instrument_vs,
					      incise_shader_instrument_fs, err);
	if (draw->metal)
		draw->ground = incise_shader_program("ground", incise_shader_ground_vs,
						     incise_shader_ground_fs, err);
	if (draw->ground)
		draw->image = incise_shader_program("image", incise_shader_image_vs,
						    incise_shader_image_fs, err);
	return draw->image ? 0 : -EIO;
}

/* Where a CPU draws, some things cost more than they show. */
static bool by_cpu(const char *name)
{
	return strstr(name, "llvmpipe") || strstr(name, "softpipe");
}

/* libepoxy ends the process when it finds none of them. */
static bool has_library(struct incise_error *err)
{
	static const char *const names[] = {"libOpenGL.so.0", "libGL.so.1"};

	for (int i = 0; i < 2; i++)
		if (dlopen(names[i], RTLD_LAZY))
			return true;
	incise_error_set(err, ENOTSUP,
			 "picture: there is no libOpenGL.so.0 and no libGL.so.1: "
			 "install libgl1");
	return false;
}

/* The lamp as seen from the middle of the texture; its height does not matter here. */
static void find_way(struct incise_draw *draw, const struct incise_chart *chart)
{
	double middle[2] = {chart->size / 2.0, chart->size / 2.0};
	double right[3], down[3], length;

	incise_chart_metric(chart, middle, right, down);
	draw->way[0] = v3_unit(right, right, 0) ? v3_dot(right, draw_key_way) : -1;
	draw->way[1] = v3_unit(down, down, 0) ? v3_dot(down, draw_key_way) : 0;
	length = hypot(draw->way[0], draw->way[1]);
	for (int k = 0; k < 2; k++)
		draw->way[k] = length > 1e-6 ? draw->way[k] / length : 1 - k;
}

struct incise_draw *incise_draw_new(const struct incise_draw_setup *setup,
				    struct incise_error *err)
{
	struct incise_texture_setup texture = {setup->canvas, setup->normal_rgb, {0}, 0};
	struct incise_draw *draw;
	bool fine;

	if (!has_library(err))
		return NULL;
	draw = calloc(1, sizeof(*draw));
	if (!draw) {
		incise_error_set(err, ENOMEM, "picture: no memory");
		return NULL;
	}
	if (epoxy_gl_version() < 33) {
		incise_error_set(err, ENOTSUP,
				 "picture: OpenGL %d.%d; 3.3 is needed: install "
				 "libgl1-mesa-dri, or run with LIBGL_ALWAYS_SOFTWARE=1",
				 epoxy_gl_version() / 10, epoxy_gl_version() % 10);
		goto out_free;
	}
	snprintf(draw->renderer, sizeof(draw->renderer), "%s",
		 (const char *)glGetString(GL_RENDERER));
	fine = !by_cpu(draw->renderer);
	draw->tool = setup->scalpel;
	draw->look = setup->look;
	draw->target.samples = setup->samples > 0 ? setup->samples : fine ? 4 : 1;
	glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
	glPixelStorei(GL_PACK_ALIGNMENT, 1);
	glGenVertexArrays(1, &draw->nothing);
	incise_solid_surface(&draw->surface, setup->chart, draw->middle_mm,
			     &draw->reach_mm);
	if (put_instruments(draw, err) || put_programs(draw, err))
		goto out_free;
	find_way(draw, setup->chart);
	texture.way[0] = draw->way[0];
	texture.way[1] = draw->way[1];
	texture.fine = fine;
	draw->texture = incise_texture_new(&texture, err);
	if (!draw->texture || failed(err))
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
		incise_solid_free(&draw->surface);
		incise_solid_free(&draw->scalpel);
		incise_solid_free(&draw->tube);
		glDeleteVertexArrays(1, &draw->nothing);
		glDeleteProgram(draw->skin);
		glDeleteProgram(draw->metal);
		glDeleteProgram(draw->ground);
		glDeleteProgram(draw->image);
		incise_texture_free(draw->texture);
		for (int i = 0; i < DRAW_SLOTS; i++)
			glDeleteTextures(1, &draw->slot[i].texture);
		incise_target_free(&draw->target);
	}
	free(draw);
}

void incise_draw_upload(struct incise_draw *draw, const struct incise_canvas *canvas,
			const struct incise_upload *uploads, int n)
{
	if (n > 0)
		incise_texture_upload(draw->texture, canvas, uploads, n);
}

int incise_draw_frame(struct incise_draw *draw, const struct incise_view_camera *camera,
		      const struct incise_tick *pose, int width, int height,
		      struct incise_error *err)
{
	struct incise_view_camera held = *camera;
	struct incise_eye eye;
	struct incise_instrument_place place;
	double off[3];
	bool placed = pose && incise_instrument_place(&draw->tool, pose, &place);
	int rc;

	if (!incise_eye_hold(&held))
		return incise_error_set(err, EINVAL, "picture: the camera is nowhere");
	rc = incise_target_size(&draw->target, width, height, err);
	if (rc)
		return rc;
	v3_sub(off, draw->middle_mm, held.target_mm);
	incise_eye_look(&held, width, height,
			v3_length(off) + draw->reach_mm + draw->tool.handle_mm + 100,
			&eye);

	glBindFramebuffer(GL_FRAMEBUFFER, draw->target.drawn);
	glViewport(0, 0, width, height);
	glDisable(GL_BLEND);
	glEnable(GL_DEPTH_TEST);
	glEnable(GL_CULL_FACE);
	glDepthFunc(GL_LEQUAL);
	glDepthMask(GL_TRUE);
	glClear(GL_DEPTH_BUFFER_BIT);
	if (placed)
		incise_draw_instrument(draw, &eye, &place);
	incise_draw_surface(draw, &eye, placed ? &place : NULL);
	/* Last, where nothing else is. */
	glUseProgram(draw->ground);
	glBindVertexArray(draw->nothing);
	glDrawArrays(GL_TRIANGLES, 0, 3);
	incise_target_resolve(&draw->target);
	draw->drawn = true;
	return failed(err);
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
			incise_texture_image(draw->slot[slot].texture, bgra, w, h);
		draw->slot[slot].version = version;
		draw->slot[slot].w = w;
		draw->slot[slot].h = h;
	}
	glBindTexture(GL_TEXTURE_2D, draw->slot[slot].texture);
	glDisable(GL_DEPTH_TEST);
	glDisable(GL_CULL_FACE);
	glEnable(GL_BLEND);
	glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
	glUseProgram(draw->image);
	glUniform1i(glGetUniformLocation(draw->image, "image"), 0);
	glUniform4f(glGetUniformLocation(draw->image, "box"),
		    (float)(2.0 * x / width - 1), (float)(1 - 2.0 * y / height),
		    (float)(2.0 * (x + w) / width - 1),
		    (float)(1 - 2.0 * (y + h) / height));
	glBindVertexArray(draw->nothing);
	glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
	return failed(NULL);
}

int incise_draw_read(struct incise_draw *draw, uint8_t *rgb, int width, int height)
{
	size_t row = (size_t)width * 3;

	if (!draw->drawn || width != draw->target.width || height != draw->target.height)
		return -EINVAL;
	glBindFramebuffer(GL_FRAMEBUFFER, draw->target.single);
	glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, rgb);
	/* OpenGL's rows begin at the bottom. */
	for (int y = 0; y < height / 2; y++) {
		uint8_t *a = rgb + y * row, *b = rgb + (height - 1 - y) * row;

		for (size_t i = 0; i < row; i++) {
			uint8_t keep = a[i];

			a[i] = b[i];
			b[i] = keep;
		}
	}
	return failed(NULL);
}

void incise_draw_show(struct incise_draw *draw)
{
	const struct incise_target *target = &draw->target;

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

void incise_draw_bounds(const struct incise_draw *draw, double middle_mm[3],
			double *reach_mm)
{
	v3_copy(middle_mm, draw->middle_mm);
	*reach_mm = draw->reach_mm;
}

int incise_draw_samples(const struct incise_draw *draw)
{
	return draw->target.samples;
}

const char *incise_draw_renderer(const struct incise_draw *draw)
{
	return draw->renderer;
}
