// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The surface and the instrument of a picture: what their shaders are told; see draw_parts.h.
 */
#include <epoxy/gl.h>
#include "../base/vector.h"
#include "draw_parts.h"
#include "shaders.h"

static void set_vector(unsigned program, const char *name, const double v[3])
{
	glUniform3f(glGetUniformLocation(program, name), (float)v[0], (float)v[1],
		    (float)v[2]);
}

static void set_scene(unsigned program, const struct incise_eye *eye)
{
	static const double sky[3] = {0, 0, 1};
	double key[3];

	v3_unit(key, draw_key_way, 0);
	glUseProgram(program);
	glUniformMatrix4fv(glGetUniformLocation(program, "clip"), 1, GL_FALSE, eye->clip);
	set_vector(program, "eye", eye->eye_mm);
	set_vector(program, "key", key);
	set_vector(program, "sky", sky);
}

/* Lines with a thickness that stand for the instrument where it throws a shadow. */
static void set_casters(const struct incise_draw *draw,
			const struct incise_instrument_place *place)
{
	double h = draw->tool.handle_mm;
	/* Along x and z, and radius: blade, handle; a straight tube, its bend. */
	const double scalpel[][3] = {
		{0, 0, 0.3}, {0.2, fmin(28, h / 4), 2.2}, {0, h, 3.2}};
	static const double tube[][3] = {
		{0, 0, 4}, {0, 27, 4}, {-18, 66, 4}, {-32, 77, 6}};
	const double(*line)[3] = place && place->tube ? tube : scalpel;
	int n = !place ? 0 : place->tube ? 3 : 2;
	float from[SHADERS_CASTERS][4], to[SHADERS_CASTERS][4];

	glUniform1i(glGetUniformLocation(draw->skin, "casters"), n);
	for (int i = 0; i < n; i++)
		for (int k = 0; k < 4; k++) {
			const double *a = line[i], *b = line[i + 1];

			from[i][k] = (float)(k == 3 ? a[2]
						    : place->origin_mm[k] +
							      a[0] * place->x[k] +
							      a[1] * place->z[k]);
			to[i][k] = (float)(k == 3 ? b[2]
						  : place->origin_mm[k] +
							    b[0] * place->x[k] +
							    b[1] * place->z[k]);
		}
	if (n) {
		glUniform4fv(glGetUniformLocation(draw->skin, "from"), n, from[0]);
		glUniform4fv(glGetUniformLocation(draw->skin, "to"), n, to[0]);
	}
}

void incise_draw_surface(struct incise_draw *draw, const struct incise_eye *eye,
			 const struct incise_instrument_place *place)
{
	set_scene(draw->skin, eye);
	set_casters(draw, place);
	glUniform1f(glGetUniformLocation(draw->skin, "texel"),
		    1.0f / (float)incise_texture_side(draw->texture));
	/* Of the texture's side; where there is none it ends beyond it. */
	glUniform1f(glGetUniformLocation(draw->skin, "cloth"),
		    draw->look == INCISE_SKIN_NECK ? 0.055f : -1.0f);
	glUniform1f(glGetUniformLocation(draw->skin, "moist"),
		    draw->look == INCISE_SKIN_LIVER ? 0.6f : 0.0f);
	glUniform2f(glGetUniformLocation(draw->skin, "way"), (float)draw->way[0],
		    (float)draw->way[1]);
	glUniform1i(glGetUniformLocation(draw->skin, "base"), 0);
	glActiveTexture(GL_TEXTURE0);
	glBindTexture(GL_TEXTURE_2D, incise_texture_name(draw->texture));
	incise_solid_draw(&draw->surface);
}

void incise_draw_instrument(struct incise_draw *draw, const struct incise_eye *eye,
			    const struct incise_instrument_place *place)
{
	float matrix[16] = {0};

	for (int k = 0; k < 3; k++) {
		matrix[k] = (float)place->x[k];
		matrix[4 + k] = (float)place->y[k];
		matrix[8 + k] = (float)place->z[k];
		matrix[12 + k] = (float)place->origin_mm[k];
	}
	matrix[15] = 1;
	set_scene(draw->metal, eye);
	glUniformMatrix4fv(glGetUniformLocation(draw->metal, "place"), 1, GL_FALSE,
			   matrix);
	incise_solid_draw(place->tube ? &draw->tube : &draw->scalpel);
}
