/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * An OpenGL 3.3 core context without a screen, by EGL. Drawing goes into a framebuffer object.
 */
#ifndef INCISE_VIEW_EGL_H
#define INCISE_VIEW_EGL_H

#include <incise/error.h>

struct incise_egl;

/*
 * The context is made current in the calling thread. NULL with errno ENOTSUP and a line
 * that names the packages, ENOMEM.
 */
struct incise_egl *incise_egl_new(struct incise_error *err);

/* Make it current. 0, -EIO. */
int incise_egl_current(struct incise_egl *egl, struct incise_error *err);

/* Releases the context from its current thread, too. */
void incise_egl_free(struct incise_egl *egl);

#endif
