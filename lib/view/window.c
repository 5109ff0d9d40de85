// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A window by SDL 2; see window.h.
 */
#define SDL_MAIN_HANDLED
#include <SDL.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include "../base/monotonic.h"
#include "window.h"

#define STICKS_MAX 8

struct incise_window {
	SDL_Window *window;
	SDL_GLContext context;
	bool video, sticks;
	SDL_Joystick *stick[STICKS_MAX];
};

/* The caller keeps its signals; fingers and pens do not become mice. */
static void set_hints(void)
{
	SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
	SDL_SetHint(SDL_HINT_TOUCH_MOUSE_EVENTS, "0");
	SDL_SetHint(SDL_HINT_MOUSE_TOUCH_EVENTS, "0");
}

/*
 * Without a screen SDL draws into memory by itself, and no user can see or end it. A user
 * who names that driver wants it.
 */
static bool is_seen(const char *driver)
{
	const char *asked = getenv("SDL_VIDEODRIVER");

	return (strcmp(driver, "offscreen") && strcmp(driver, "dummy")) ||
	       (asked && strstr(asked, driver));
}

static int open_window(struct incise_window *window, const char *title, int width,
		       int height, struct incise_error *err)
{
	const Uint32 flags =
		SDL_WINDOW_OPENGL | SDL_WINDOW_RESIZABLE | SDL_WINDOW_ALLOW_HIGHDPI;

	window->video = !SDL_InitSubSystem(SDL_INIT_VIDEO);
	if (!window->video || !is_seen(SDL_GetCurrentVideoDriver()))
		return incise_error_set(
			err, ENODEV,
			"image: no screen for a window (%s); set DISPLAY or "
			"WAYLAND_DISPLAY",
			window->video ? "SDL finds none" : SDL_GetError());
	SDL_GL_SetAttribute(SDL_GL_CONTEXT_MAJOR_VERSION, 3);
	SDL_GL_SetAttribute(SDL_GL_CONTEXT_MINOR_VERSION, 3);
	SDL_GL_SetAttribute(SDL_GL_CONTEXT_PROFILE_MASK, SDL_GL_CONTEXT_PROFILE_CORE);
	SDL_GL_SetAttribute(SDL_GL_DOUBLEBUFFER, 1);
	/* Drawing happens in another framebuffer, which has a depth. */
	SDL_GL_SetAttribute(SDL_GL_DEPTH_SIZE, 0);
	window->window =
		SDL_CreateWindow(title ? title : "incise", SDL_WINDOWPOS_CENTERED,
				 SDL_WINDOWPOS_CENTERED, width, height, flags);
	if (window->window)
		window->context = SDL_GL_CreateContext(window->window);
	if (!window->context)
		return incise_error_set(
			err, ENOTSUP,
			"image: no window with OpenGL 3.3 (%s); install libgl1 and "
			"libgl1-mesa-dri, or run with LIBGL_ALWAYS_SOFTWARE=1",
			SDL_GetError());
	/* In step with the screen; late frames at once, if supported. */
	if (SDL_GL_SetSwapInterval(-1))
		SDL_GL_SetSwapInterval(1);
	return 0;
}

struct incise_window *incise_window_new(const char *title, int width, int height,
					struct incise_error *err)
{
	struct incise_window *window = calloc(1, sizeof(*window));
	int rc;

	if (!window)
		return INCISE_ERROR_NULL(err, ENOMEM, "image: no memory");
	set_hints();
	rc = open_window(window, title, width, height, err);
	if (rc) {
		incise_window_free(window);
		errno = -rc;
		return NULL;
	}
	/* Joysticks are optional. */
	window->sticks = !SDL_InitSubSystem(SDL_INIT_JOYSTICK);
	return window;
}

void incise_window_free(struct incise_window *window)
{
	if (!window)
		return;
	for (int i = 0; i < STICKS_MAX; i++)
		if (window->stick[i])
			SDL_JoystickClose(window->stick[i]);
	if (window->context)
		SDL_GL_DeleteContext(window->context);
	if (window->window)
		SDL_DestroyWindow(window->window);
	if (window->sticks)
		SDL_QuitSubSystem(SDL_INIT_JOYSTICK);
	if (window->video)
		SDL_QuitSubSystem(SDL_INIT_VIDEO);
	free(window);
}

int incise_window_current(struct incise_window *window, struct incise_error *err)
{
	if (!SDL_GL_MakeCurrent(window->window, window->context))
		return 0;
	return incise_error_set(
		err, EIO, "image: the window's graphics were lost (%s); start again",
		SDL_GetError());
}

void incise_window_size(const struct incise_window *window, int *width, int *height)
{
	*width = *height = 0;
	if (!(SDL_GetWindowFlags(window->window) &
	      (SDL_WINDOW_MINIMIZED | SDL_WINDOW_HIDDEN)))
		SDL_GL_GetDrawableSize(window->window, width, height);
}

void incise_window_show(struct incise_window *window)
{
	SDL_GL_SwapWindow(window->window);
}

/* SDL uses desktop coordinates; a pixel of the frame may be smaller. */
static void place_window_pointer(const struct incise_window *window, double x, double y,
				 struct incise_view_event *event)
{
	int wide, high, w, h;

	SDL_GL_GetDrawableSize(window->window, &w, &h);
	SDL_GetWindowSize(window->window, &wide, &high);
	event->x_px = wide > 0 ? (x + 0.5) * w / wide : 0;
	event->y_px = high > 0 ? (y + 0.5) * h / high : 0;
}

static void finger(const struct incise_window *window, const SDL_TouchFingerEvent *from,
		   struct incise_view_event *event)
{
	int w, h;

	SDL_GL_GetDrawableSize(window->window, &w, &h);
	event->x_px = (double)from->x * w;
	event->y_px = (double)from->y * h;
	event->pressure = from->pressure;
	event->buttons = from->type != SDL_FINGERUP;
}

static unsigned held(Uint32 state)
{
	return (state & SDL_BUTTON_LMASK ? 1 : 0) | (state & SDL_BUTTON_MMASK ? 2 : 0) |
	       (state & SDL_BUTTON_RMASK ? 4 : 0);
}

static int key_of(SDL_Keycode key)
{
	static const struct {
		SDL_Keycode from;
		int to;
	} named[] = {
		{SDLK_LEFT, INCISE_VIEW_LEFT},
		{SDLK_RIGHT, INCISE_VIEW_RIGHT},
		{SDLK_UP, INCISE_VIEW_UP},
		{SDLK_DOWN, INCISE_VIEW_DOWN},
		{SDLK_PAGEUP, INCISE_VIEW_PAGE_UP},
		{SDLK_PAGEDOWN, INCISE_VIEW_PAGE_DOWN},
		{SDLK_HOME, INCISE_VIEW_HOME},
		{SDLK_END, INCISE_VIEW_END},
		{SDLK_LSHIFT, INCISE_VIEW_SHIFT},
		{SDLK_RSHIFT, INCISE_VIEW_SHIFT},
		{SDLK_LCTRL, INCISE_VIEW_CTRL},
		{SDLK_RCTRL, INCISE_VIEW_CTRL},
	};

	if (key > 0 && key < 0x110000)
		return key;
	for (size_t i = 0; i < sizeof(named) / sizeof(named[0]); i++)
		if (named[i].from == key)
			return named[i].to;
	if (key >= SDLK_F1 && key <= SDLK_F12)
		return INCISE_VIEW_F1 + (int)(key - SDLK_F1);
	return 0;
}

static int stick_of(const struct incise_window *window, SDL_JoystickID id)
{
	for (int i = 0; i < STICKS_MAX; i++)
		if (window->stick[i] && SDL_JoystickInstanceID(window->stick[i]) == id)
			return i;
	return -1;
}

static void stick_added(struct incise_window *window, int device)
{
	for (int i = 0; i < STICKS_MAX; i++)
		if (!window->stick[i]) {
			window->stick[i] = SDL_JoystickOpen(device);
			return;
		}
}

static void stick_removed(struct incise_window *window, SDL_JoystickID id)
{
	int i = stick_of(window, id);

	if (i < 0)
		return;
	SDL_JoystickClose(window->stick[i]);
	window->stick[i] = NULL;
}

static bool take_key(const SDL_KeyboardEvent *from, struct incise_view_event *to)
{
	to->type = INCISE_VIEW_KEY;
	to->key = key_of(from->keysym.sym);
	to->pressed = from->state == SDL_PRESSED;
	to->repeat = from->repeat != 0;
	return to->key != 0;
}

static bool take_button(const struct incise_window *window,
			const SDL_MouseButtonEvent *from, struct incise_view_event *to)
{
	to->type = INCISE_VIEW_BUTTON;
	to->button = from->button;
	to->pressed = from->state == SDL_PRESSED;
	to->buttons = held(SDL_GetMouseState(NULL, NULL));
	to->pressure = 1;
	place_window_pointer(window, from->x, from->y, to);
	return true;
}

static bool take_wheel(const struct incise_window *window,
		       const SDL_MouseWheelEvent *from, struct incise_view_event *to)
{
	int x, y;

	to->type = INCISE_VIEW_WHEEL;
	to->wheel = from->direction == SDL_MOUSEWHEEL_FLIPPED ? -from->preciseY
							      : from->preciseY;
	to->buttons = held(SDL_GetMouseState(&x, &y));
	place_window_pointer(window, x, y, to);
	return true;
}

static bool take_stick(const struct incise_window *window, const SDL_Event *from,
		       struct incise_view_event *to)
{
	if (from->type == SDL_JOYAXISMOTION) {
		to->type = INCISE_VIEW_AXIS;
		to->stick = stick_of(window, from->jaxis.which);
		to->axis = from->jaxis.axis;
		to->value = from->jaxis.value < 0 ? from->jaxis.value / 32768.0
						  : from->jaxis.value / 32767.0;
	} else {
		to->type = INCISE_VIEW_STICK_BUTTON;
		to->stick = stick_of(window, from->jbutton.which);
		to->button = from->jbutton.button;
		to->pressed = from->jbutton.state == SDL_PRESSED;
	}
	return to->stick >= 0;
}

static bool take_window(const struct incise_window *window, const SDL_WindowEvent *from,
			struct incise_view_event *to)
{
	if (from->event == SDL_WINDOWEVENT_CLOSE)
		to->type = INCISE_VIEW_QUIT;
	else if (from->event == SDL_WINDOWEVENT_SIZE_CHANGED)
		to->type = INCISE_VIEW_RESIZE;
	else
		return false;
	if (to->type == INCISE_VIEW_RESIZE)
		SDL_GL_GetDrawableSize(window->window, &to->width, &to->height);
	return true;
}

/* Returns whether the event is reported. */
static bool take(struct incise_window *window, const SDL_Event *from,
		 struct incise_view_event *to)
{
	switch (from->type) {
	case SDL_QUIT:
		to->type = INCISE_VIEW_QUIT;
		return true;
	case SDL_WINDOWEVENT:
		return take_window(window, &from->window, to);
	case SDL_KEYDOWN:
	case SDL_KEYUP:
		return take_key(&from->key, to);
	case SDL_MOUSEMOTION:
		to->type = INCISE_VIEW_MOTION;
		to->buttons = held(from->motion.state);
		to->pressure = 1;
		place_window_pointer(window, from->motion.x, from->motion.y, to);
		return true;
	case SDL_MOUSEBUTTONDOWN:
	case SDL_MOUSEBUTTONUP:
		return take_button(window, &from->button, to);
	case SDL_MOUSEWHEEL:
		return take_wheel(window, &from->wheel, to);
	case SDL_FINGERMOTION:
		to->type = INCISE_VIEW_MOTION;
		finger(window, &from->tfinger, to);
		return true;
	case SDL_FINGERDOWN:
	case SDL_FINGERUP:
		to->type = INCISE_VIEW_BUTTON;
		to->button = 1;
		to->pressed = from->type == SDL_FINGERDOWN;
		finger(window, &from->tfinger, to);
		return true;
	case SDL_JOYAXISMOTION:
	case SDL_JOYBUTTONDOWN:
	case SDL_JOYBUTTONUP:
		return take_stick(window, from, to);
	case SDL_JOYDEVICEADDED:
		stick_added(window, from->jdevice.which);
		return false;
	case SDL_JOYDEVICEREMOVED:
		stick_removed(window, from->jdevice.which);
		return false;
	default:
		return false;
	}
}

int incise_window_event(struct incise_window *window, struct incise_view_event *event)
{
	SDL_Event from;

	while (SDL_PollEvent(&from)) {
		SDL_Keymod mod = SDL_GetModState();

		memset(event, 0, sizeof(*event));
		event->t_ns = incise_monotonic_ns();
		event->shift = mod & KMOD_SHIFT;
		event->ctrl = mod & KMOD_CTRL;
		if (take(window, &from, event))
			return 1;
	}
	return 0;
}
