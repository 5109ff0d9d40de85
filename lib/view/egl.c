// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A context without a screen; see egl.h. It tries Mesa's platform without surfaces, which needs no
 * display server; then EGL's default display, with a small unused surface in memory.
 *
 * A process shares its displays: terminating one here would destroy other contexts.
 */
#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <epoxy/common.h>
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include "egl.h"

#define HINT "install libegl1 and libgl1-mesa-dri to draw without a screen"

struct incise_egl {
	EGLDisplay display;
	EGLSurface surface; /* or EGL_NO_SURFACE */
	EGLContext context;
};

static EGLDisplay surfaceless(void)
{
	const char *extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
	PFNEGLGETPLATFORMDISPLAYEXTPROC get;

	if (!epoxy_extension_in_string(extensions, "EGL_MESA_platform_surfaceless") ||
	    !epoxy_extension_in_string(extensions, "EGL_EXT_platform_base"))
		return EGL_NO_DISPLAY;
	get = (PFNEGLGETPLATFORMDISPLAYEXTPROC)eglGetProcAddress(
		"eglGetPlatformDisplayEXT");
	return get ? get(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, NULL)
		   : EGL_NO_DISPLAY;
}

static bool open_display(struct incise_egl *egl, EGLDisplay display)
{
	EGLint major, minor;

	if (display == EGL_NO_DISPLAY || !eglInitialize(display, &major, &minor))
		return false;
	egl->display = display;
	return (major > 1 || minor >= 4) && eglBindAPI(EGL_OPENGL_API);
}

static bool open_context(struct incise_egl *egl)
{
	static const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT,
					EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
	static const EGLint core[] = {EGL_CONTEXT_MAJOR_VERSION,
				      3,
				      EGL_CONTEXT_MINOR_VERSION,
				      3,
				      EGL_CONTEXT_OPENGL_PROFILE_MASK,
				      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
				      EGL_NONE};
	static const EGLint small[] = {EGL_WIDTH, 16, EGL_HEIGHT, 16, EGL_NONE};
	const char *extensions = eglQueryString(egl->display, EGL_EXTENSIONS);
	EGLConfig config;
	EGLint n = 0;

	if (!eglChooseConfig(egl->display, wanted, &config, 1, &n) || n < 1)
		return false;
	egl->context = eglCreateContext(egl->display, config, EGL_NO_CONTEXT, core);
	if (egl->context == EGL_NO_CONTEXT)
		return false;
	if (!epoxy_extension_in_string(extensions, "EGL_KHR_surfaceless_context")) {
		egl->surface = eglCreatePbufferSurface(egl->display, config, small);
		if (egl->surface == EGL_NO_SURFACE)
			return false;
	}
	return eglMakeCurrent(egl->display, egl->surface, egl->surface, egl->context);
}

static void shut(struct incise_egl *egl)
{
	if (egl->context != EGL_NO_CONTEXT) {
		if (eglGetCurrentContext() == egl->context)
			eglMakeCurrent(egl->display, EGL_NO_SURFACE, EGL_NO_SURFACE,
				       EGL_NO_CONTEXT);
		eglDestroyContext(egl->display, egl->context);
	}
	if (egl->surface != EGL_NO_SURFACE)
		eglDestroySurface(egl->display, egl->surface);
	egl->context = EGL_NO_CONTEXT;
	egl->surface = EGL_NO_SURFACE;
}

struct incise_egl *incise_egl_new(struct incise_error *err)
{
	struct incise_egl *egl = calloc(1, sizeof(*egl));
	EGLint why;

	if (!egl)
		return INCISE_ERROR_NULL(err, ENOMEM, "image: no memory");
	egl->surface = EGL_NO_SURFACE;
	egl->context = EGL_NO_CONTEXT;
	if (open_display(egl, surfaceless()) && open_context(egl))
		return egl;
	shut(egl);
	if (open_display(egl, eglGetDisplay(EGL_DEFAULT_DISPLAY)) && open_context(egl))
		return egl;
	why = eglGetError();
	shut(egl);
	free(egl);
	return INCISE_ERROR_NULL(err, ENOTSUP,
				 "image: EGL has no OpenGL 3.3 here (error 0x%x); " HINT,
				 (unsigned)why);
}

int incise_egl_current(struct incise_egl *egl, struct incise_error *err)
{
	/* The API is per thread: another library may have bound OpenGL ES. */
	if (eglBindAPI(EGL_OPENGL_API) &&
	    eglMakeCurrent(egl->display, egl->surface, egl->surface, egl->context))
		return 0;
	return incise_error_set(err, EIO,
				"image: the graphics context was lost (EGL 0x%x); "
				"start again",
				(unsigned)eglGetError());
}

void incise_egl_free(struct incise_egl *egl)
{
	if (!egl)
		return;
	shut(egl);
	free(egl);
}
