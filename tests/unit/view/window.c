// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A window of SDL's driver `offscreen`, with a context and no screen; events are pushed into SDL's
 * queue. tests/cli has a real window under Xvfb.
 */
#include "../unit.h"
#define SDL_MAIN_HANDLED
#include <SDL.h>
#include <epoxy/gl.h>
#include "../../../lib/view/window.h"
#include "look.h"

static struct incise_window *window;

static int setup(void **state)
{
	struct incise_error err = {0};
	struct incise_view_event event;

	/*
	 * A display that is not ended, as egl.c leaves it, keeps the driver mapped when SDL
	 * lets go of it: else the sanitizer does not see that its own lists are still held.
	 */
	incise_egl_free(look_context());
	setenv("SDL_VIDEODRIVER", "offscreen", 1);
	window = incise_window_new("test", 320, 200, &err);
	if (!window)
		printf("skipped: %s\n", err.text);
	while (window && incise_window_event(window, &event))
		;
	return 0;
}

static int teardown(void **state)
{
	incise_window_free(window);
	incise_window_free(NULL);
	return 0;
}

static struct incise_view_event sent(SDL_Event from)
{
	struct incise_view_event event;

	assert_int_equal(SDL_PushEvent(&from), 1);
	/* SDL reports "none" once between events of before and after the last poll. */
	if (!incise_window_event(window, &event))
		assert_int_equal(incise_window_event(window, &event), 1);
	assert_true(event.t_ns > 0);
	return event;
}

TEST(test_context_and_size)
{
	int w, h;

	if (!window)
		skip();
	assert_int_equal(incise_window_current(window, NULL), 0);
	assert_true(epoxy_gl_version() >= 33);
	incise_window_size(window, &w, &h);
	assert_int_equal(w, 320);
	assert_int_equal(h, 200);
	glClear(GL_COLOR_BUFFER_BIT);
	incise_window_show(window);
	assert_int_equal(glGetError(), GL_NO_ERROR);
}

TEST(test_keys)
{
	static const struct {
		SDL_Keycode from;
		int to;
	} cases[] = {
		{SDLK_a, 'a'},
		{SDLK_SPACE, ' '},
		{SDLK_ESCAPE, 27},
		{SDLK_LEFT, INCISE_VIEW_LEFT},
		{SDLK_PAGEDOWN, INCISE_VIEW_PAGE_DOWN},
		{SDLK_RSHIFT, INCISE_VIEW_SHIFT},
		{SDLK_F1, INCISE_VIEW_F1},
		{SDLK_F12, INCISE_VIEW_F1 + 11},
	};

	if (!window)
		skip();
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct incise_view_event event =
			sent((SDL_Event){.key = {.type = SDL_KEYDOWN,
						 .state = SDL_PRESSED,
						 .repeat = i & 1,
						 .keysym.sym = cases[i].from}});

		assert_int_equal(event.type, INCISE_VIEW_KEY);
		assert_int_equal(event.key, cases[i].to);
		assert_true(event.pressed && event.repeat == (i & 1));
	}
}

TEST(test_mouse)
{
	struct incise_view_event event;

	if (!window)
		skip();
	event = sent(
		(SDL_Event){.motion = {.type = SDL_MOUSEMOTION,
				       .x = 10,
				       .y = 20,
				       .state = SDL_BUTTON_LMASK | SDL_BUTTON_RMASK}});
	assert_int_equal(event.type, INCISE_VIEW_MOTION);
	/* The middle of the pixel. */
	assert_true(event.x_px == 10.5 && event.y_px == 20.5);
	assert_int_equal(event.buttons, 5);
	assert_true(event.pressure == 1);
	event = sent((SDL_Event){.button = {.type = SDL_MOUSEBUTTONDOWN,
					    .button = 3,
					    .state = SDL_PRESSED}});
	assert_true(event.type == INCISE_VIEW_BUTTON && event.button == 3 &&
		    event.pressed);
	event = sent((SDL_Event){.wheel = {.type = SDL_MOUSEWHEEL,
					   .preciseY = 1.5f,
					   .direction = SDL_MOUSEWHEEL_FLIPPED}});
	assert_true(event.type == INCISE_VIEW_WHEEL && event.wheel == -1.5);
}

TEST(test_finger)
{
	struct incise_view_event event;

	if (!window)
		skip();
	event = sent((SDL_Event){.tfinger = {.type = SDL_FINGERDOWN,
					     .x = 0.5f,
					     .y = 0.25f,
					     .pressure = 0.75f}});
	assert_true(event.type == INCISE_VIEW_BUTTON && event.pressed);
	assert_true(event.x_px == 160 && event.y_px == 50 && event.pressure == 0.75);
	event = sent((SDL_Event){.tfinger = {.type = SDL_FINGERUP, .x = 0.5f}});
	assert_true(event.type == INCISE_VIEW_BUTTON && !event.pressed);
	assert_int_equal(event.buttons, 0);
}

TEST(test_others)
{
	struct incise_view_event event;
	SDL_Event unknown = {.type = SDL_USEREVENT};
	/* Events of missing joysticks. */
	SDL_Event axis = {.jaxis = {.type = SDL_JOYAXISMOTION, .which = 77}};
	SDL_Event gone = {.jdevice = {.type = SDL_JOYDEVICEREMOVED, .which = 77}};
	SDL_Event added = {.jdevice = {.type = SDL_JOYDEVICEADDED, .which = 77}};

	if (!window)
		skip();
	event = sent((SDL_Event){.type = SDL_QUIT});
	assert_int_equal(event.type, INCISE_VIEW_QUIT);
	event = sent((SDL_Event){.window = {.type = SDL_WINDOWEVENT,
					    .event = SDL_WINDOWEVENT_SIZE_CHANGED}});
	assert_int_equal(event.type, INCISE_VIEW_RESIZE);
	assert_int_equal(event.width, 320);
	SDL_PushEvent(&unknown);
	SDL_PushEvent(&added);
	SDL_PushEvent(&axis);
	SDL_PushEvent(&gone);
	assert_int_equal(incise_window_event(window, &event), 0);
	assert_int_equal(incise_window_event(window, &event), 0);
}

TEST(test_no_screen)
{
	if (!window)
		skip();
	incise_window_free(window);
	setenv("SDL_VIDEODRIVER", "none-such", 1);
	window = incise_window_new("test", 320, 200, &err);
	assert_null(window);
	assert_int_equal(errno, ENODEV);
	assert_says(err.text, "DISPLAY");
}

GROUP(setup, teardown);
