/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages of Haply's Inverse Service, JSON with a decimal point whatever the locale. They come from
 * outside: what is not as expected is no value.
 *
 *     frame    {"inverse3": [{"device_id": "049D", "config": {…}, "state": {…}, "status": {…}}],
 *               "verse_grip": […], "wireless_verse_grip": […], "custom_verse_grip": […]}
 *     command  {"inverse3": [{"device_id": "049D", "commands": {"set_cursor_force":
 *               {"vector": {"x": 0, "y": 0, "z": 1.5}}}}]}
 *     event    {"name": "device-safety-triggered", "level": "error", "message": "…",
 *               "data": {"device_id": "049D", "safety_type": "ebrake_triggered"}}
 */
#ifndef INCISE_HAPLY_MESSAGE_H
#define INCISE_HAPLY_MESSAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <incise/haptic.h>

#define HAPLY_FRAME_MAX 65536 /* bytes; a longer one is not read */
#define HAPLY_COMMAND_MAX 512
#define HAPLY_ID_SIZE 24
#define HAPLY_BUTTONS 4 /* button or a, b, c, hall */

enum haply_format {
	HAPLY_3_0, /* objects by ids in place of lists, in commands too; "values" */
	HAPLY_3_1, /* lists; a force has "values" */
	HAPLY_3_5, /* a force has "vector"; sessions */
};

struct haply_frame {
	char id[HAPLY_ID_SIZE];	  /* of the Inverse3 that follows; "": it is not there */
	char grip[HAPLY_ID_SIZE]; /* of its VerseGrip; "": none */
	int n;			  /* number of Inverse3 … */
	char ids[200];		  /* … and their ids */
	const char *not_ready;	  /* reason and what to do, or NULL */
	double position_mm[3];	  /* NaN: none; so of velocities */
	double velocity_mm_s[3];
	double quaternion[4]; /* w first; 1 0 0 0: none */
	uint32_t buttons;     /* the first is bit 0 */
	bool scaled;	      /* positions and forces are not those of the hand */
	bool has_config;      /* then: */
	enum haply_format format;
	bool own_gravity, mount_scaled;
	char filters[200]; /* settings that change how a force feels */
};

/*
 * Read a frame for the Inverse3 @id and the VerseGrip @grip; "": the first of each; @grip NULL: without one.
 * 0; -EPROTO: it is none.
 */
int haply_frame_parse(struct haply_frame *frame, const char *text, size_t n,
		      const char *id, const char *grip);

/*
 * Print a command with a force, which is finite; @session: a request of 3.5 beside it, or NULL. The length;
 * 0: it does not fit.
 */
size_t haply_command_print(char *text, size_t size, enum haply_format format,
			   const char *id, const double force_N[3], const char *session);
#define HAPLY_NAME_SESSION "{\"configure\":{\"profile\":{\"name\":\"incise\"}}}"
#define HAPLY_ASK_CONFIG "{\"force_render_full_state\":{}}"

/* States that events begin and end, beside INCISE_HAPTIC_BATTERY and INCISE_HAPTIC_CHANGED. */
enum haply_protection {
	HAPLY_BRAKE = 16,
	HAPLY_FOREIGN_OBJECT = 32,
	HAPLY_BRIEF = 64, /* no event ends it */
};

/*
 * Read an event: the state that begins, with words for people; negative: that ends; 0: none of these. A
 * safety event without a type is a brake that another event ends.
 */
int haply_event_parse(const char *text, size_t n, const char *id, const char *grip,
		      char *words, size_t size);

#endif
