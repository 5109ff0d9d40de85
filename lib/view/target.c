// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What is drawn on; see target.h.
 */
#include <epoxy/gl.h>
#include <errno.h>
#include <string.h>
#include "target.h"

static unsigned buffer(const struct incise_target *target, int samples, GLenum format)
{
	unsigned name;

	glGenRenderbuffers(1, &name);
	glBindRenderbuffer(GL_RENDERBUFFER, name);
	glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples > 1 ? samples : 0,
					 format, target->width, target->height);
	return name;
}

static unsigned frame(unsigned colour, unsigned depth)
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

static int complete(struct incise_target *target)
{
	int good;

	target->colour = buffer(target, target->samples, GL_RGBA8);
	target->depth = buffer(target, target->samples, GL_DEPTH_COMPONENT24);
	target->drawn = frame(target->colour, target->depth);
	good = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
	target->single = target->drawn;
	if (target->samples > 1) {
		target->pixels = buffer(target, 1, GL_RGBA8);
		target->single = frame(target->pixels, 0);
		good &= glCheckFramebufferStatus(GL_FRAMEBUFFER) ==
			GL_FRAMEBUFFER_COMPLETE;
	}
	return good && glGetError() == GL_NO_ERROR;
}

int incise_target_size(struct incise_target *target, int width, int height,
		       struct incise_error *err)
{
	int side_max = 0, samples_max = 1, samples = target->samples;

	if (target->drawn && target->width == width && target->height == height)
		return 0;
	glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &side_max);
	glGetIntegerv(GL_MAX_SAMPLES, &samples_max);
	if (width < 1 || height < 1 || width > side_max || height > side_max)
		return incise_error_set(err, EINVAL,
					"picture: %d × %d pixels; expected 1 to %d each",
					width, height, side_max);
	incise_target_free(target);
	target->width = width;
	target->height = height;
	target->samples = samples < samples_max ? samples : samples_max;
	while (!complete(target)) {
		samples = target->samples / 2;
		incise_target_free(target);
		if (samples < 1) {
			target->width = target->height = 0;
			return incise_error_set(
				err, ENOTSUP,
				"picture: no framebuffer of %d × %d pixels: "
				"a smaller picture may do",
				width, height);
		}
		target->samples = samples;
	}
	return 0;
}

void incise_target_resolve(const struct incise_target *target)
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

void incise_target_free(struct incise_target *target)
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
