/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The picture of a scene: its surface with skin, wound and blood, the instrument, and a
 * panel of what the loop does. Part of libincise-view.
 *
 *     ticks ──▶ wound, blood ──▶ texture ──▶ frame ──▶ window
 *                                              ╰─────▶ pixels
 *
 * What is drawn depends on the ticks and on the camera only, not on when frames are drawn:
 * ticks do all to the texture, a frame shows the state after the last of them.
 *
 * A view belongs to the thread that made it, all of its functions: its OpenGL context is
 * that thread's. None of them is for a loop's thread; who draws a loop reads its ticks by
 * incise_state_ticks().
 */
#ifndef INCISE_VIEW_H
#define INCISE_VIEW_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/plan.h>
#include <incise/scene.h>

INCISE_BEGIN_DECLS

struct incise_view;

#define INCISE_VIEW_SIDE_MAX 8192 /**< of a picture, pixels */

/** What a view is to be. */
struct incise_view_setup {
	int width, height; /**< pixels, 16 … INCISE_VIEW_SIDE_MAX */
	bool window;	   /**< on a screen, by SDL; else in memory, which needs none */
	const char *title; /**< of the window; or NULL */
	/** Per pixel: 1, or 4 for smooth edges; 0: 4 by a card, 1 where the CPU draws. */
	int samples;
};

/**
 * Make the picture of a scene. Paints the skin, which takes some tenths of a second at
 * 2048 texels.
 *
 * @param scene lives as long as the view
 * @param plan  compiled from it: its surface is drawn. Lives as long as the view, but may
 *              tick in another thread
 * @return view, to be freed with incise_view_free(); NULL with errno EINVAL (size), ENODEV
 *         (no screen for a window), ENOTSUP (no OpenGL 3.3, or too small textures; the
 *         packages that bring it are named), ENOMEM.
 */
INCISE_API struct incise_view *incise_view_new(const struct incise_scene *scene,
					       const struct incise_plan *plan,
					       const struct incise_view_setup *setup,
					       struct incise_error *err);

/** NULL is accepted. In the thread that made it. */
INCISE_API void incise_view_free(struct incise_view *view);

/**
 * Tell of ticks, oldest first, each once. Numbers that are not finite, or are beyond 1e6,
 * are left out of the picture.
 */
INCISE_API void incise_view_ticks(struct incise_view *view,
				  const struct incise_tick *ticks, int n);

/** What the panel tells of the loop beside its ticks. */
struct incise_view_status {
	const char *state; /**< "running" …; or NULL */
	double rate_hz;	   /**< NAN where not known, as below */
	double lateness_median_us;
	double lateness_999_us; /**< that 99.9 % of the ticks were not later than */
	uint64_t lost;		/**< ticks that the picture did not get */
};

/**
 * Draw the state after the last tick; in a window show it, and wait for the screen where
 * that can be waited for.
 *
 * @param status or NULL: the panel says nothing of it
 * @return 0, also when a window is closed up and nothing can be drawn; -EIO (the
 *         graphics failed: the view is of no more use), -ENOMEM
 */
INCISE_API int incise_view_frame(struct incise_view *view,
				 const struct incise_view_status *status,
				 struct incise_error *err);

/** How large the last frame is: a window can be resized. Pixels. */
INCISE_API void incise_view_size(const struct incise_view *view, int *width, int *height);

/**
 * The last frame's pixels, as its size was.
 *
 * @param rgb room for width × height × 3 bytes, rows from the top; sRGB
 * @return 0, -ENODATA (no frame was drawn), -EIO
 */
INCISE_API int incise_view_pixels(struct incise_view *view, uint8_t *rgb);

/**
 * What is shown over the picture; at first the panel and not the keys. The panel is left out
 * of pictures of less than 360 000 pixels.
 */
INCISE_API void incise_view_panel(struct incise_view *view, bool panel, bool keys);

/**
 * What the help says of the caller's keys, above the view's own: lines "KEY\tWHAT IT
 * DOES". The first 18 are shown.
 *
 * @param lines are copied
 * @return 0, -ENOMEM
 */
INCISE_API int incise_view_keys(struct incise_view *view, const char *const *lines,
				int n);

/**
 * From where one looks. At azimuth 0 along +y, at 90 along -x; at elevation 90 straight
 * down along -z, with the same side up.
 *
 *          z ▲      ○ eye
 *            │    ╱ distance_mm
 *            │  ╱ elevation_deg
 *            ● ───────▶ azimuth_deg, from -y round z
 *         target
 */
struct incise_view_camera {
	double target_mm[3];
	double azimuth_deg;
	double elevation_deg; /**< -89 … 89 */
	double distance_mm;   /**< 1 … 1e5 */
	double fov_deg;	      /**< across the height; 5 … 120 */
};

/** Where it is seen from. */
INCISE_API void incise_view_camera(const struct incise_view *view,
				   struct incise_view_camera *camera);

/** Values out of range are held at it; with one that is not finite nothing is changed. */
INCISE_API void incise_view_set_camera(struct incise_view *view,
				       const struct incise_view_camera *camera);

/** A straight way into the picture, and where it meets the tissue. */
struct incise_view_ray {
	double from_mm[3]; /**< the eye */
	double way[3];	   /**< unit */
	bool met;	   /**< the surface, from outside */
	double point_mm[3];
	double normal[3]; /**< outward, unit */
};

/** What happened at the window. */
enum incise_view_event_type {
	INCISE_VIEW_KEY,
	INCISE_VIEW_MOTION, /**< of the mouse, a pen or a finger */
	INCISE_VIEW_BUTTON, /**< of one of them */
	INCISE_VIEW_WHEEL,
	INCISE_VIEW_AXIS,	  /**< of a joystick */
	INCISE_VIEW_STICK_BUTTON, /**< of it */
	INCISE_VIEW_RESIZE,
	INCISE_VIEW_QUIT, /**< the window shall be closed */
};

/** Keys that are no character: above all of Unicode's. */
enum incise_view_key {
	INCISE_VIEW_LEFT = 0x110001,
	INCISE_VIEW_RIGHT,
	INCISE_VIEW_UP,
	INCISE_VIEW_DOWN,
	INCISE_VIEW_PAGE_UP,
	INCISE_VIEW_PAGE_DOWN,
	INCISE_VIEW_HOME,
	INCISE_VIEW_END,
	INCISE_VIEW_SHIFT,
	INCISE_VIEW_CTRL,
	INCISE_VIEW_F1, /**< … F12 = F1 + 11 */
};

/** What somebody did at a window. Fields that do not belong to the type are 0. */
struct incise_view_event {
	enum incise_view_event_type type;
	int64_t t_ns; /**< CLOCK_MONOTONIC, when it was read here */
	/**
	 * The view did something with it: right button or arrows turn the camera, middle
	 * button moves it, wheel comes near or far, Home goes back, F1 or h shows the keys,
	 * g the panel.
	 */
	bool used;
	int key;      /**< KEY: character (small letter), or enum incise_view_key */
	bool pressed; /**< KEY, BUTTON, STICK_BUTTON: else released */
	bool repeat;  /**< KEY: held down */
	bool shift, ctrl;
	unsigned
		buttons; /**< MOTION, BUTTON, WHEEL: held now; bit 0 left, 1 middle, 2 right */
	int button;	 /**< BUTTON: 1 left, 2 middle, 3 right; STICK_BUTTON: from 0 */
	double x_px, y_px;	    /**< MOTION, BUTTON, WHEEL: where, as in the frame */
	struct incise_view_ray ray; /**< there */
	double pressure; /**< MOTION, BUTTON: of a pen or finger, 0 … 1; of a mouse 1 */
	double wheel;	 /**< WHEEL: notches, up is positive */
	int stick;	 /**< AXIS, STICK_BUTTON: which joystick, from 0 */
	int axis;	 /**< AXIS: from 0 */
	double value;	 /**< AXIS: -1 … 1 */
	int width, height; /**< RESIZE: of the frames from now on, pixels */
};

/**
 * The next event, without waiting.
 *
 * @return 1; 0 when there is none, or the view has no window
 */
INCISE_API int incise_view_event(struct incise_view *view,
				 struct incise_view_event *event);

/** What effects have done so far. */
struct incise_view_report {
	double cut_mm;	 /**< length of all cuts */
	uint64_t stamps; /**< of the wound into the texture */
	/** Blood: all that came, and where it is. emitted = drops + trails + off. */
	double blood_ul_emitted, blood_ul_drops, blood_ul_trails, blood_ul_off;
	int drops;
	uint64_t uploads; /**< rectangles sent to the graphics, all levels */
	uint64_t uploaded_texels;
	uint64_t ticks; /**< that were told */
	uint64_t frames;
	/**
	 * What it took so far, s: what ticks do to wound and blood; the texture, from what has
	 * changed to the graphics; drawing. Without a window the latter is all of it, for a
	 * frame is finished before incise_view_frame() returns.
	 */
	double ticks_s, texture_s, draw_s;
	int triangles, texture_px;
	const char *renderer; /**< OpenGL's name of it; lives as long as the view */
	int samples;	      /**< per pixel */
};

/** What was drawn so far, and what it took. */
INCISE_API void incise_view_report(const struct incise_view *view,
				   struct incise_view_report *report);

INCISE_END_DECLS
#endif
