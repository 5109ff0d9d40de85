/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The image of a scene: its surface with skin, wound and blood, the instrument, and a panel about
 * the loop. Part of libincise-view.
 *
 *     ticks ──▶ wound, blood ──▶ texture ──▶ frame ──▶ window
 *                                              ╰─────▶ pixels
 *
 * Images depend only on the ticks and the camera, not on the times of frames: ticks change the
 * texture, and a frame shows the state after the last tick.
 *
 * Call the functions of a view only in the thread that made it, whose OpenGL context it uses,
 * and not in a loop's thread; incise_state_ticks() reads a loop's ticks.
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

#define INCISE_VIEW_SIDE_MAX 8192 /**< largest side of an image, pixels */

/** Options of a view. */
struct incise_view_setup {
	int width, height; /**< pixels, 16 … INCISE_VIEW_SIDE_MAX */
	bool window;	   /**< on a screen, with SDL; else in memory, without a screen */
	const char *title; /**< title of the window; or NULL */
	/** Samples per pixel: 1, or 4 for smooth edges; 0: 4 on a GPU, 1 on a CPU. */
	int samples;
	/**
	 * Prefer timely frames to complete ones: large changes of the texture are distributed
	 * over this and the next frames. A frame then depends on the previous ones.
	 */
	bool live;
};

/**
 * Make the view of a scene. Paints the skin, which takes some tenths of a second at 2048 texels.
 *
 * @param scene must outlive the view
 * @param plan  compiled from the scene, for its surface; must outlive the view, but may tick
 *              in another thread
 * @return view, to be freed with incise_view_free(); NULL with errno EINVAL (size), ENODEV
 *         (no screen for a window), ENOTSUP (no OpenGL 3.3, or too small textures; @err names
 *         the packages), ENOMEM.
 */
INCISE_API struct incise_view *incise_view_new(const struct incise_scene *scene,
					       const struct incise_plan *plan,
					       const struct incise_view_setup *setup,
					       struct incise_error *err);

/** NULL is accepted. In the thread that made it. */
INCISE_API void incise_view_free(struct incise_view *view);

/**
 * Add ticks, oldest first, each once. Values that are not finite, or beyond 1e6, are ignored.
 */
INCISE_API void incise_view_ticks(struct incise_view *view,
				  const struct incise_tick *ticks, int n);

/** Values of the panel other than ticks. */
struct incise_view_status {
	const char *state; /**< "running" …; or NULL */
	double rate_hz;	   /**< NAN if unknown, as below */
	double lateness_median_us;
	double lateness_999_us; /**< 99.9 % quantile */
	uint64_t lost;		/**< ticks that did not reach the view */
};

/**
 * Draw the state after the last tick; show it in a window, synchronised with the screen if
 * supported.
 *
 * @param status for the panel, or NULL
 * @return 0, also if a window is minimized and nothing can be drawn; -EIO (the graphics
 *         failed: the view is unusable), -ENOMEM
 */
INCISE_API int incise_view_frame(struct incise_view *view,
				 const struct incise_view_status *status,
				 struct incise_error *err);

/** Size of the last frame, pixels: a window can be resized. */
INCISE_API void incise_view_size(const struct incise_view *view, int *width, int *height);

/**
 * Read the pixels of the last frame.
 *
 * @param rgb capacity of width × height × 3 bytes, rows from the top; sRGB
 * @return 0, -ENODATA (no frame was drawn), -EIO
 */
INCISE_API int incise_view_pixels(struct incise_view *view, uint8_t *rgb);

/**
 * Make an image of a line of text, black in the middle of white; white alone where no font is.
 *
 * @param rgb capacity of width × height × 3 bytes, rows from the top
 * @return 0, -EINVAL (a side is not 1 … INCISE_VIEW_SIDE_MAX), -ENOMEM
 */
INCISE_API int incise_view_caption(uint8_t *rgb, int width, int height, const char *line);

/**
 * Show or hide panel and keys over the image; initially only the panel is shown. Images below
 * 360 000 pixels have no panel.
 */
INCISE_API void incise_view_panel(struct incise_view *view, bool panel, bool keys);

/**
 * Set the help for the caller's keys, above the view's own: lines "KEY\tEFFECT". The first 18
 * are shown.
 *
 * @param lines help lines, copied
 * @return 0, -ENOMEM
 */
INCISE_API int incise_view_keys(struct incise_view *view, const char *const *lines,
				int n);

/**
 * The camera. At azimuth 0 it looks along +y, at 90 along -x; at elevation 90 straight down along
 * -z, with the same side up.
 *
 *          z ▲      ○ camera
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

/** Get the current camera. */
INCISE_API void incise_view_camera(const struct incise_view *view,
				   struct incise_view_camera *camera);

/**
 * Set the camera. Values are clamped to their ranges; if one is not finite, nothing changes.
 */
INCISE_API void incise_view_set_camera(struct incise_view *view,
				       const struct incise_view_camera *camera);

/** A ray into the image, and its point on the tissue. */
struct incise_view_ray {
	double from_mm[3]; /**< the camera */
	double way[3];	   /**< unit */
	bool met;	   /**< it enters the surface from outside */
	double point_mm[3];
	double normal[3]; /**< outward, unit */
};

/** Types of events of a window. */
enum incise_view_event_type {
	INCISE_VIEW_KEY,
	INCISE_VIEW_MOTION, /**< of mouse, pen or finger */
	INCISE_VIEW_BUTTON, /**< of mouse, pen or finger */
	INCISE_VIEW_WHEEL,
	INCISE_VIEW_AXIS,	  /**< of a joystick */
	INCISE_VIEW_STICK_BUTTON, /**< of a joystick */
	INCISE_VIEW_RESIZE,
	INCISE_VIEW_QUIT, /**< the user closes the window */
};

/** Keys without a character, above the range of Unicode. */
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

/** An event of a window. Fields that do not belong to the type are 0. */
struct incise_view_event {
	enum incise_view_event_type type;
	int64_t t_ns; /**< CLOCK_MONOTONIC at its reading */
	/**
	 * The view used it: right button or arrows turn the camera, middle button moves it,
	 * the wheel changes the distance, Home resets it, F1 or h shows the keys, g the panel.
	 */
	bool used;
	int key;      /**< KEY: character (small letter), or enum incise_view_key */
	bool pressed; /**< KEY, BUTTON, STICK_BUTTON: else released */
	bool repeat;  /**< KEY: held down */
	bool shift, ctrl;
	unsigned
		buttons; /**< MOTION, BUTTON, WHEEL: held now; bit 0 left, 1 middle, 2 right */
	int button;	 /**< BUTTON: 1 left, 2 middle, 3 right; STICK_BUTTON: from 0 */
	double x_px, y_px;	    /**< MOTION, BUTTON, WHEEL: position in the frame */
	struct incise_view_ray ray; /**< ray at that position */
	/** MOTION, BUTTON: pressure of pen or finger, 0 … 1; mouse: 1 */
	double pressure;
	double wheel;	   /**< WHEEL: notches, up is positive */
	int stick;	   /**< AXIS, STICK_BUTTON: number of the joystick, from 0 */
	int axis;	   /**< AXIS: from 0 */
	double value;	   /**< AXIS: -1 … 1 */
	int width, height; /**< RESIZE: new size of frames, pixels */
};

/**
 * Get the next event, without waiting.
 *
 * @return 1; 0 if there is none, or the view has no window
 */
INCISE_API int incise_view_event(struct incise_view *view,
				 struct incise_view_event *event);

/** Counts and times of a view. */
struct incise_view_report {
	double cut_mm;	 /**< length of all cuts */
	uint64_t stamps; /**< segments of the wound */
	/** Blood: emitted = drops + trails + off. */
	double blood_ul_emitted, blood_ul_drops, blood_ul_trails, blood_ul_off;
	int drops;
	uint64_t uploads; /**< rectangles sent to the graphics, on all levels */
	uint64_t uploaded_texels;
	uint64_t ticks; /**< added ticks */
	uint64_t frames;
	/**
	 * Times, s: ticks for wound and blood; texture updates; drawing (complete only without
	 * a window, where incise_view_frame() finishes the frame).
	 */
	double ticks_s, texture_s, draw_s;
	int triangles, texture_px;
	const char *renderer; /**< name in OpenGL; valid as long as the view */
	int samples;	      /**< samples per pixel */
};

/** Report counts and times so far. */
INCISE_API void incise_view_report(const struct incise_view *view,
				   struct incise_view_report *report);

INCISE_END_DECLS
#endif
