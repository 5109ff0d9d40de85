// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Messages of Haply's Inverse Service; see haply_message.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <jansson.h>
#include "../../base/control_character.h"
#include "haply_message.h"

#define DEVICES_MAX 8 /* of a kind that are looked at; their ids fit */
#define MM 1e3
#define POSITION_MOST_MM 1e4
#define VELOCITY_MOST_MM_S 1e6
#define UNIT_TOLERANCE 0.02 /* of the square of a quaternion's length */

/* Three numbers of at most @most; false: *xyz is NaN. */
static bool read_xyz(json_t *object, const char *key, double unit, double most,
		     double xyz[3])
{
	bool ok = !json_unpack(object, "{s:{s:F, s:F, s:F}}", key, "x", &xyz[0], "y",
			       &xyz[1], "z", &xyz[2]);

	for (int i = 0; i < 3; i++) {
		xyz[i] *= unit;
		ok = ok && fabs(xyz[i]) <= most;
	}
	for (int i = 0; i < 3 && !ok; i++)
		xyz[i] = NAN;
	return ok;
}

static bool is_id(const char *id)
{
	static const char letters[] = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
				      "abcdefghijklmnopqrstuvwxyz-_.:";
	size_t n = id ? strlen(id) : 0;

	return n && n < HAPLY_ID_SIZE && strspn(id, letters) == n;
}

/* Device @i of a kind, in either form, and its id; NULL: no more. */
static json_t *get_device(json_t *kind, size_t i, const char **id)
{
	json_t *device = json_array_get(kind, i);
	void *at = json_object_iter(kind);

	*id = json_string_value(json_object_get(device, "device_id"));
	if (!at)
		return device;
	while (at && i--)
		at = json_object_iter_next(kind, at);
	*id = json_object_iter_key(at);
	return json_object_iter_value(at);
}

/* The device @wanted, "": the first, with its id; or NULL. */
static json_t *find_device(json_t *kind, const char *wanted, char id[HAPLY_ID_SIZE])
{
	const char *name;
	json_t *device;

	for (size_t i = 0; i < DEVICES_MAX && (device = get_device(kind, i, &name)); i++)
		if (is_id(name) && (!*wanted || !strcmp(wanted, name))) {
			snprintf(id, HAPLY_ID_SIZE, "%s", name);
			return device;
		}
	return NULL;
}

/* The reason why a device is not ready, or NULL. Older formats and grips do not say each. */
static const char *check_status(const json_t *status)
{
	static const struct {
		const char *key, *denied;
	} claims[] = {
		{"power_supply", "has no power supply; plug it in"},
		{"started", "has not started; switch it on"},
		{"calibrated", "is not calibrated; calibrate it, as its manual says"},
		{"connected", "has a VerseGrip that is not connected; pair it"},
		{"awake", "has a VerseGrip that sleeps; press one of its buttons"},
		{"ready", "or its VerseGrip is not ready; see their lights"},
	};

	for (size_t i = 0; i < sizeof(claims) / sizeof(*claims); i++) {
		const json_t *claim = json_object_get(status, claims[i].key);

		if (claim && !json_is_true(claim))
			return claims[i].denied;
	}
	return NULL;
}

static bool is_scaled(json_t *transform)
{
	double xyz[3] = {0};

	return json_object_get(transform, "scale") &&
	       !(read_xyz(transform, "scale", 1, 2, xyz) &&
		 fabs(xyz[0] - 1) + fabs(xyz[1] - 1) + fabs(xyz[2] - 1) < 1e-6);
}

/* As "force_gate:gain:0.3,damping:scalar:0.0,torque_scaling:enabled:true,…" */
static void print_filters(char *text, size_t size, const json_t *config)
{
	static const char *const keys[] = {"force_gate",     "damping",
					   "torque_scaling", "gravity_compensation",
					   "handedness",     "streaming_mode"};
	const json_t *filters = json_object_get(config, "filters");
	json_t *all = json_object();
	char json[1000] = "";
	size_t n = 0;

	for (size_t i = 0; i < sizeof(keys) / sizeof(*keys); i++)
		json_object_set(all, keys[i],
				json_object_get(i < 2 ? filters : config, keys[i]));
	json_dumpb(all, json, sizeof(json) - 1, JSON_COMPACT | JSON_REAL_PRECISION(6));
	json_decref(all);
	for (const char *c = json; *c && n < size - 1; c++)
		if (!strchr("{}\"", *c))
			text[n++] = *c;
	text[n] = 0;
	control_characters_hide(text);
}

static void read_inverse3(struct haply_frame *frame, json_t *device)
{
	json_t *config = json_object_get(device, "config");
	json_t *state = json_object_get(device, "state");
	int on = 0;

	frame->has_config = json_is_object(config);
	if (json_object_get(config, "filters") && frame->format == HAPLY_3_1)
		frame->format = HAPLY_3_5;
	json_unpack(config, "{s:{s:b}}", "gravity_compensation", "enabled", &on);
	frame->own_gravity = on;
	print_filters(frame->filters, sizeof(frame->filters), config);
	frame->mount_scaled = is_scaled(json_object_get(config, "mount"));
	frame->scaled = is_scaled(json_object_get(state, "transform"));
	frame->not_ready = check_status(json_object_get(device, "status"));
	read_xyz(state, "cursor_velocity", MM, VELOCITY_MOST_MM_S, frame->velocity_mm_s);
	if (!read_xyz(state, "cursor_position", MM, POSITION_MOST_MM, frame->position_mm))
		frame->not_ready = "sent no position; see the messages of its service";
}

static void read_grip(struct haply_frame *frame, json_t *grip)
{
	json_t *state = json_object_get(grip, "state");
	const char *denied = check_status(json_object_get(grip, "status"));
	int a = 0, b = 0, c = 0, hall = 0;
	double q[4], size2 = 0;

	json_unpack(state, "{s?b, s?i, s?{s?b, s?b, s?b}}", "button", &a, "hall", &hall,
		    "buttons", "a", &a, "b", &b, "c", &c);
	frame->buttons = (uint32_t)(a | b << 1 | c << 2 | (hall != 0) << 3);
	if (!json_unpack(state, "{s:{s:F, s:F, s:F, s:F}}", "orientation", "w", &q[0],
			 "x", &q[1], "y", &q[2], "z", &q[3]))
		size2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
	if (fabs(size2 - 1) < UNIT_TOLERANCE)
		memcpy(frame->quaternion, q, sizeof(q));
	else if (!denied)
		denied = "has a VerseGrip that sends no orientation; plug it in again";
	if (!frame->not_ready)
		frame->not_ready = denied;
}

static void read_frame(struct haply_frame *frame, const json_t *root, const char *id,
		       const char *grip)
{
	static const char *const grips[] = {"verse_grip", "wireless_verse_grip",
					    "custom_verse_grip"};
	json_t *kind = json_object_get(root, "inverse3"), *device;
	const char *name;

	*frame = (struct haply_frame){.quaternion = {1},
				      .position_mm = {NAN, NAN, NAN},
				      .velocity_mm_s = {NAN, NAN, NAN},
				      .not_ready = "is not there; plug it in"};
	frame->format = json_is_object(kind) ? HAPLY_3_0 : HAPLY_3_1;
	for (size_t i = 0; i < DEVICES_MAX && get_device(kind, i, &name); i++)
		if (is_id(name))
			sprintf(frame->ids + strlen(frame->ids), "%s%s",
				frame->n++ ? ", " : "", name);
	device = find_device(kind, id, frame->id);
	if (device)
		read_inverse3(frame, device);
	device = NULL;
	for (int i = 0; i < 3 && !device && grip; i++)
		device = find_device(json_object_get(root, grips[i]), grip, frame->grip);
	if (device)
		read_grip(frame, device);
	else if (grip && *grip && !frame->not_ready)
		frame->not_ready = "has lost its VerseGrip; plug or pair it again";
}

/* An object, or NULL. */
static json_t *load_object(const char *text, size_t n)
{
	json_t *root = n < HAPLY_FRAME_MAX ? json_loadb(text, n, 0, NULL) : NULL;

	if (json_is_object(root))
		return root;
	json_decref(root);
	return NULL;
}

int haply_frame_parse(struct haply_frame *frame, const char *text, size_t n,
		      const char *id, const char *grip)
{
	json_t *root = load_object(text, n);

	if (!root)
		return -EPROTO;
	read_frame(frame, root, id, grip);
	json_decref(root);
	return 0;
}

size_t haply_command_print(char *text, size_t size, enum haply_format format,
			   const char *id, const double force_N[3], const char *session)
{
	json_t *commands = json_pack("{s:{s:{s:f, s:f, s:f}}}", "set_cursor_force",
				     format == HAPLY_3_5 ? "vector" : "values", "x",
				     force_N[0], "y", force_N[1], "z", force_N[2]);
	json_t *root =
		format == HAPLY_3_0
			? json_pack("{s:{s:{s:o}}}", "inverse3", id, "commands", commands)
			: json_pack("{s:[{s:s, s:o}]}", "inverse3", "device_id", id,
				    "commands", commands);
	size_t n;

	if (session && format == HAPLY_3_5)
		json_object_set_new(root, "session", json_loads(session, 0, NULL));
	n = json_dumpb(root, text, size, JSON_COMPACT);
	json_decref(root);
	return n <= size ? n : 0;
}

/* A member of another type does not hide the others. */
static const char *get_text(const json_t *object, const char *key, const char *without)
{
	const char *text = json_string_value(json_object_get(object, key));

	return text ? text : without;
}

int haply_event_parse(const char *text, size_t n, const char *id, const char *grip,
		      char *words, size_t size)
{
	json_t *root = load_object(text, n), *data = json_object_get(root, "data");
	const char *name = get_text(root, "name", "");
	const char *level = get_text(root, "level", "");
	const char *of = get_text(data, "device_id", id);
	const char *type = get_text(data, "safety_type", NULL);
	int state = 0;

	if (strcmp(of, id) && strcmp(of, grip))
		state = 0;
	else if (!strcmp(name, "device-disconnected") && !strcmp(of, id))
		state = INCISE_HAPTIC_CHANGED;
	else if (!strncmp(name, "device-battery", 14))
		state = INCISE_HAPTIC_BATTERY;
	else if (!strcmp(name, "device-busy"))
		state = HAPLY_BRIEF;
	else if (!strcmp(name, "device-safety-triggered"))
		state = !type || !strncmp(type, "ebrake", 6) ? HAPLY_BRAKE
			: !strncmp(type, "fod", 3)	     ? HAPLY_FOREIGN_OBJECT
							     : HAPLY_BRIEF;
	if (type && (state == HAPLY_BRAKE || state == HAPLY_FOREIGN_OBJECT) &&
	    (!strcmp(level, "info") || !strcmp(level, "notice")))
		state = -state;
	if (state > 0) {
		snprintf(words, size, "%.40s: %.100s", name,
			 get_text(root, "message", ""));
		control_characters_hide(words);
	}
	json_decref(root);
	return state;
}
