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
#define POSITION_MOST_M 10
#define VELOCITY_MOST_M_S 1000
#define UNIT_TOLERANCE 0.02 /* of the square of a quaternion's length */

/* Members whose names are a letter each. False unless all are numbers of at most @most: then all are NaN. */
static bool read_numbers(const json_t *object, const char *letters, double most,
			 double unit, double *numbers)
{
	bool all = true;

	for (int i = 0; letters[i]; i++) {
		const json_t *member =
			json_object_get(object, (const char[]){letters[i], 0});

		numbers[i] = json_is_number(member) ? json_number_value(member) : NAN;
		all = all && fabs(numbers[i]) <= most;
		numbers[i] *= unit;
	}
	for (int i = 0; letters[i] && !all; i++)
		numbers[i] = NAN;
	return all;
}

static bool is_id(const char *id)
{
	size_t n = id ? strlen(id) : 0;

	return n && n < HAPLY_ID_SIZE &&
	       strspn(id, "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
			  "abcdefghijklmnopqrstuvwxyz-_.:") == n;
}

/* Device @i of a kind, in either form, and its id; NULL: no more. */
static json_t *get_device(json_t *kind, size_t i, const char **id)
{
	json_t *device = json_array_get(kind, i);
	void *at = json_object_iter(kind);

	*id = json_string_value(json_object_get(device, "device_id"));
	if (!json_is_object(kind))
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

static bool is_scaled(const json_t *transform)
{
	const json_t *scale = json_object_get(transform, "scale");
	double xyz[3];

	return scale && !(read_numbers(scale, "xyz", 2, 1, xyz) &&
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

static void read_config(struct haply_frame *frame, const json_t *config)
{
	frame->has_config = true;
	if (frame->format == HAPLY_3_1 && json_object_get(config, "filters"))
		frame->format = HAPLY_3_5;
	frame->mount_scaled = is_scaled(json_object_get(config, "mount"));
	frame->own_gravity = json_is_true(json_object_get(
		json_object_get(config, "gravity_compensation"), "enabled"));
	print_filters(frame->filters, sizeof(frame->filters), config);
}

static void read_inverse3(struct haply_frame *frame, const json_t *device)
{
	const json_t *state = json_object_get(device, "state");
	const json_t *config = json_object_get(device, "config");

	if (json_is_object(config))
		read_config(frame, config);
	frame->not_ready = check_status(json_object_get(device, "status"));
	frame->scaled = is_scaled(json_object_get(state, "transform"));
	read_numbers(json_object_get(state, "cursor_velocity"), "xyz", VELOCITY_MOST_M_S,
		     1e3, frame->velocity_mm_s);
	if (!read_numbers(json_object_get(state, "cursor_position"), "xyz",
			  POSITION_MOST_M, 1e3, frame->position_mm))
		frame->not_ready = "sent no position; see the messages of its service";
}

static uint32_t read_buttons(const json_t *state)
{
	const json_t *buttons = json_object_get(state, "buttons");
	const json_t *first = json_object_get(state, "button");
	const json_t *pressed[HAPLY_BUTTONS] = {
		first ? first : json_object_get(buttons, "a"),
		json_object_get(buttons, "b"),
		json_object_get(buttons, "c"),
		json_object_get(state, "hall"),
	};
	uint32_t bits = 0;

	for (int i = 0; i < HAPLY_BUTTONS; i++)
		if (json_is_true(pressed[i]) || json_integer_value(pressed[i]))
			bits |= 1u << i;
	return bits;
}

static void read_grip(struct haply_frame *frame, const json_t *grip)
{
	const json_t *state = json_object_get(grip, "state");
	const char *denied = check_status(json_object_get(grip, "status"));
	double q[4], size2 = 0;

	frame->buttons = read_buttons(state);
	if (read_numbers(json_object_get(state, "orientation"), "wxyz", 2, 1, q))
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
	for (int i = 0; i < 3 && !device; i++)
		device = find_device(json_object_get(root, grips[i]), grip, frame->grip);
	if (device)
		read_grip(frame, device);
	else if (*grip && !frame->not_ready)
		frame->not_ready = "has lost its VerseGrip; plug or pair it again";
}

int haply_frame_parse(struct haply_frame *frame, const char *text, size_t n,
		      const char *id, const char *grip)
{
	json_t *root = n < HAPLY_FRAME_MAX ? json_loadb(text, n, 0, NULL) : NULL;
	bool is_frame = json_is_object(root);

	if (is_frame)
		read_frame(frame, root, id, grip);
	json_decref(root);
	return is_frame ? 0 : -EPROTO;
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

static int read_event(const json_t *root, const char *id, const char *grip)
{
	const json_t *data = json_object_get(root, "data");
	const char *of = json_string_value(json_object_get(data, "device_id"));
	const char *type = json_string_value(json_object_get(data, "safety_type"));
	const char *name = json_string_value(json_object_get(root, "name"));
	const char *level = json_string_value(json_object_get(root, "level"));
	bool ends = level && (!strcmp(level, "info") || !strcmp(level, "notice"));

	if (!name || (of && strcmp(of, id) && strcmp(of, grip)))
		return 0;
	if (!strcmp(name, "device-disconnected"))
		return of && !strcmp(of, id) ? HAPLY_UNPLUGGED : 0;
	if (!strncmp(name, "device-battery", 14))
		return HAPLY_BATTERY;
	if (!strcmp(name, "device-busy"))
		return HAPLY_BRIEF;
	if (strcmp(name, "device-safety-triggered") != 0)
		return 0;
	if (type && !strncmp(type, "ebrake", 6))
		return ends ? -HAPLY_BRAKE : HAPLY_BRAKE;
	if (type && !strncmp(type, "fod", 3))
		return ends ? -HAPLY_FOREIGN_OBJECT : HAPLY_FOREIGN_OBJECT;
	return HAPLY_BRIEF;
}

int haply_event_parse(const char *text, size_t n, const char *id, const char *grip,
		      char *words, size_t size)
{
	json_t *root = n < HAPLY_FRAME_MAX ? json_loadb(text, n, 0, NULL) : NULL;
	const char *message = json_string_value(json_object_get(root, "message"));
	int state = read_event(root, id, grip);

	if (state > 0)
		snprintf(words, size, "%s: %.100s",
			 json_string_value(json_object_get(root, "name")),
			 message ? message : "");
	if (state > 0)
		control_characters_hide(words);
	json_decref(root);
	return state;
}
