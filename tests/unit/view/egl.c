// SPDX-License-Identifier: GPL-2.0-or-later
/* Contexts without a screen. */
#include "../unit.h"
#include <epoxy/gl.h>
#include "look.h"

TEST(test_two_do_not_meddle)
{
	struct incise_egl *a = look_context(), *b;
	unsigned texture = 0;

	if (!a)
		skip();
	assert_true(epoxy_gl_version() >= 33);
	glGenTextures(1, &texture);
	glBindTexture(GL_TEXTURE_2D, texture);
	assert_true(glIsTexture(texture));
	b = incise_egl_new(NULL);
	assert_non_null(b);
	assert_false(glIsTexture(texture));
	assert_int_equal(incise_egl_current(a, NULL), 0);
	assert_true(glIsTexture(texture));
	/* Freeing a context that is not current does not affect the current one. */
	incise_egl_free(b);
	assert_true(glIsTexture(texture));
	assert_int_equal(glGetError(), GL_NO_ERROR);
	incise_egl_free(a);
	incise_egl_free(NULL);
}

TEST(test_again_and_again)
{
	for (int i = 0; i < 5; i++) {
		struct incise_egl *egl = look_context();

		if (!egl)
			skip();
		assert_int_equal(incise_egl_current(egl, NULL), 0);
		incise_egl_free(egl);
	}
}
