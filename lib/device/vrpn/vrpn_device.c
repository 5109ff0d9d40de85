// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A device of a VRPN server; see vrpn_device.h.
 */
#include <endian.h>
#include <errno.h>
#include <math.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/monotonic.h"
#include "../../base/vector.h"
#include "vrpn_device.h"

#define SECOND_NS INT64_C(1000000000)
#define PORT 3883
#define VERSION "vrpn: ver. 07."
#define COOKIE 24
#define HEADER 24
#define FIELD 64 /* bytes of the payload of a force field */
#define RADIUS_M 2
#define CLOSE_MS 200
#define RETRY_NS (SECOND_NS / 4)
#define GONE_NS (10 * SECOND_NS)
#define FIRST_NS (5 * SECOND_NS)     /* for enough poses to know the rate */
#define LEARN_NS (SECOND_NS * 2 / 5) /* a window of poses */
#define POSES_LEAST 5
#define RATE_LEAST 1.0 /* Hz */
#define DESCRIBES_SENDER (-1)
#define DESCRIBES_TYPE (-2)
#define BUTTONS 32
#define PLACE_MOST_MM 1e6
/* The square of a quaternion's length: further off is no rotation; nearer is a unit, left as it is. */
#define LENGTH_OFF 0.02
#define LENGTH_UNIT 1e-9
#define VALUE_OUT_OF_RANGE 0 /* a force error: of a surface, which nobody set here */

static const struct {
	const char *name;
	size_t n; /* bytes of its payload; 0: any */
} types[VRPN_TYPES] = {
	/* sensor, 0; position; quaternion, w last */
	[VRPN_POSE] = {"vrpn_Tracker Pos_Quat", 64},
	/* sensor, 0; velocity; its turn, in so many seconds */
	[VRPN_VELOCITY] = {"vrpn_Tracker Velocity", 72},
	/* button, whether it is pressed */
	[VRPN_BUTTON] = {"vrpn_Button Change", 8},
	/* how many, then each */
	[VRPN_BUTTONS] = {"vrpn_Button States", 0},
	/* code */
	[VRPN_FORCE_ERROR] = {"vrpn_ForceDevice Force_Error", 4},
	/* only sent */
	[VRPN_FORCE_FIELD] = {"vrpn_ForceDevice Force_Field", 0},
};

static uint32_t get_word(const uint8_t *from)
{
	uint32_t word;

	memcpy(&word, from, sizeof(word));
	return be32toh(word);
}

static double get_double(const uint8_t *from)
{
	uint64_t bits = (uint64_t)get_word(from) << 32 | get_word(from + 4);
	double value;

	memcpy(&value, &bits, sizeof(value));
	return value;
}

static size_t pad(size_t n)
{
	return (n + 7) / 8 * 8;
}

/* --- what is sent -------------------------------------------------------------------- */

static uint8_t *put_word(uint8_t *to, uint32_t word)
{
	word = htobe32(word);
	memcpy(to, &word, sizeof(word));
	return to + sizeof(word);
}

static size_t pack_header(uint8_t *to, size_t n, int32_t sender, int32_t type)
{
	int64_t utc_ns = incise_read_clock_ns(CLOCK_REALTIME);

	memset(to, 0, HEADER + pad(n));
	to = put_word(to, (uint32_t)(HEADER + n));
	to = put_word(to, (uint32_t)(utc_ns / SECOND_NS));
	to = put_word(to, (uint32_t)(utc_ns % SECOND_NS / 1000));
	to = put_word(to, (uint32_t)sender);
	put_word(to, (uint32_t)type);
	return HEADER + pad(n);
}

/* The name behind a number 0 of this side. */
static size_t pack_name(uint8_t *to, int32_t kind, const char *name)
{
	size_t n = strlen(name) + 1;
	size_t size = pack_header(to, 4 + n, 0, kind);

	put_word(to + HEADER, (uint32_t)n);
	memcpy(to + HEADER + 4, name, n);
	return size;
}

static bool send_bytes(const struct vrpn_device *device, const uint8_t *bytes, size_t n)
{
	return send(device->link.fd, bytes, n, MSG_NOSIGNAL) == (ssize_t)n;
}

/* Behind its own description: a server repeats names that it gets. */
static void send_names(struct vrpn_device *device)
{
	uint8_t bytes[2 * (HEADER + VRPN_NAME + 4)];
	size_t n = pack_name(bytes, DESCRIBES_SENDER, device->device);

	n += pack_name(bytes + n, DESCRIBES_TYPE, types[VRPN_FORCE_FIELD].name);
	device->named = send_bytes(device, bytes, n);
}

static uint8_t *put_single(uint8_t *to, double value)
{
	float single = (float)value;
	uint32_t bits;

	memcpy(&bits, &single, sizeof(bits));
	return put_word(to, bits);
}

/* Origin, force, Jacobian, radius. */
static bool send_field(const struct vrpn_device *device, const double force_N[3],
		       double radius_m)
{
	uint8_t bytes[HEADER + FIELD], *to = bytes + HEADER;

	pack_header(bytes, FIELD, 0, 0);
	for (int i = 0; i < 3; i++)
		to = put_single(to, device->origin_m[i]);
	for (int i = 0; i < 3; i++)
		to = put_single(to, force_N[i]);
	put_single(bytes + HEADER + FIELD - 4, radius_m);
	return send_bytes(device, bytes, sizeof(bytes));
}

/* --- its ends ------------------------------------------------------------------------ */

static void forget_numbers(struct vrpn_device *device)
{
	device->sender = -1;
	for (int i = 0; i < VRPN_TYPES; i++)
		device->types[i] = -1;
}

void vrpn_device_init(struct vrpn_device *device, uint32_t sensors, int64_t silent_ns)
{
	device->link.fd = device->link.stop = -1;
	device->sensors = sensors;
	device->silent_ns = silent_ns;
	forget_numbers(device);
}

static void end_force(struct vrpn_device *device)
{
	if (!device->named)
		return;
	send_field(device, (const double[3]){0}, 0);
	shutdown(device->link.fd, SHUT_WR);
	device->named = false;
	device->leaving = true;
}

/*
 * Poses that wait on a connection as it is closed reset it, and a reset may overtake the force. False: the
 * server has closed, too.
 */
static bool drop_poses(const struct vrpn_device *device)
{
	uint8_t bytes[4096];

	return recv(device->link.fd, bytes, sizeof(bytes), 0);
}

static int fail(struct vrpn_device *device, int code, const char *what)
{
	return incise_haptic_end(&device->haptic, -code,
				 "%s %s; see its server's messages, and start both again",
				 device->haptic.info.name, what);
}

/* A sample, since a loop stops its force by that. */
static void put_break(struct vrpn_device *device)
{
	struct incise_haptic_sample *sample = &device->last.sample;

	device->last.sound = device->waits = true;
	sample->seq++;
	sample->t_ns =
		sample->t_ns < device->arrival_ns ? device->arrival_ns : sample->t_ns + 1;
	for (int i = 0; i < 3; i++) {
		sample->position_mm[i] = 1000 * device->origin_m[i];
		sample->velocity_mm_s[i] = NAN;
	}
	memcpy(sample->quaternion, (const double[4]){1}, sizeof(sample->quaternion));
}

/* An opened device is connected again, by vrpn_device_receive(). */
static int break_link(struct vrpn_device *device, int code, const char *what)
{
	bool new = !device->broken_ns;

	if (!device->learnt)
		return fail(device, code, what);
	if (new)
		device->broken_ns = device->arrival_ns;
	end_force(device);
	device->at = device->n = 0;
	device->greeted = device->met = device->waits = false;
	device->held = device->leaving = true;
	device->clock = (struct incise_sender_clock){0};
	device->retry_ns = device->arrival_ns + RETRY_NS;
	forget_numbers(device);
	incise_pace_broken(&device->pace);
	if (new && device->forces)
		put_break(device);
	snprintf(device->haptic.cause, sizeof(device->haptic.cause),
		 "%s %s; it is connected again for 10 s, see its server's messages",
		 device->haptic.info.name, what);
	return 0;
}

/* --- what comes ---------------------------------------------------------------------- */

/* The last description of a number, or of a name, is valid. */
static void describe(int32_t *number, const char *name, int32_t described,
		     const uint8_t *payload, size_t n)
{
	const char *text = (const char *)payload + 4;
	size_t length = strlen(name);

	if (n >= 4 + length && !memcmp(text, name, length) &&
	    (n == 4 + length || !text[length]))
		*number = described;
	else if (*number == described)
		*number = -1;
}

/* False: the device has another number now, so it may be another one. */
static bool take_description(struct vrpn_device *device, int32_t kind, int32_t number,
			     const uint8_t *payload, size_t n)
{
	int32_t before = device->sender;

	if (kind == DESCRIBES_SENDER && number >= 0)
		describe(&device->sender, device->device, number, payload, n);
	for (int i = 0; kind == DESCRIBES_TYPE && number >= 0 && i < VRPN_TYPES; i++)
		describe(&device->types[i], types[i].name, number, payload, n);
	return before < 0 || device->sender == before;
}

static int64_t find_time(struct vrpn_device *device, int64_t utc_ns)
{
	int64_t t_ns =
		utc_ns - (incise_read_clock_ns(CLOCK_REALTIME) - incise_monotonic_ns());

	if (!utc_ns)
		return device->arrival_ns;
	if (device->own_machine && t_ns <= device->arrival_ns &&
	    device->arrival_ns - t_ns < SECOND_NS)
		return t_ns;
	return incise_sender_time(&device->clock, utc_ns, device->arrival_ns);
}

static bool place_pose(struct incise_haptic_sample *sample, const uint8_t *payload)
{
	double *q = sample->quaternion, length2 = 0;

	for (int i = 0; i < 3; i++) {
		sample->position_mm[i] = 1000 * get_double(payload + 8 + 8 * i);
		if (!(fabs(sample->position_mm[i]) <= PLACE_MOST_MM))
			return false;
	}
	for (int i = 0; i < 4; i++) {
		q[i] = get_double(payload + 32 + 8 * ((i + 3) % 4));
		length2 += q[i] * q[i];
	}
	if (!(fabs(length2 - 1) <= LENGTH_OFF))
		return false;
	for (int i = 0; i < 4 && fabs(length2 - 1) > LENGTH_UNIT; i++)
		q[i] /= sqrt(length2);
	return true;
}

static void take_pose(struct vrpn_device *device, const uint8_t *payload, int64_t utc_ns)
{
	uint32_t sensor = get_word(payload);
	struct vrpn_pose pose = {
		.sample = {.t_ns = find_time(device, utc_ns),
			   .seq = device->last.sample.seq + 1,
			   .velocity_mm_s = {NAN, NAN, NAN}},
		.utc_ns = utc_ns,
		.sensor = (int)sensor,
	};

	if (sensor >= VRPN_SENSORS || !(device->sensors >> sensor & 1))
		return;
	/* Sensors of one frame have one timestamp. */
	if (pose.sample.t_ns <= device->last.sample.t_ns)
		pose.sample.t_ns = device->last.sample.t_ns + 1;
	pose.sound = place_pose(&pose.sample, payload);
	if (pose.sound) {
		device->sound_ns = device->arrival_ns;
		if (device->broken_ns && !device->force_error)
			*device->haptic.cause = '\0';
		device->broken_ns = 0;
		for (int i = 0; i < 3; i++)
			device->origin_m[i] = pose.sample.position_mm[i] / 1000;
	}
	device->haptic.lost += !pose.sound;
	device->last = pose;
	device->waits = true;
}

static void take_velocity(struct vrpn_device *device, const uint8_t *payload,
			  int64_t utc_ns)
{
	struct vrpn_pose *last = &device->last;

	if (get_word(payload) != (uint32_t)last->sensor || utc_ns != last->utc_ns)
		return;
	device->haptic.info.features |= INCISE_HAPTIC_PAGE_VELOCITY;
	for (int i = 0; i < 3; i++)
		last->sample.velocity_mm_s[i] = 1000 * get_double(payload + 8 + 8 * i);
}

static void take_button(struct vrpn_device *device, size_t button, uint32_t state)
{
	if (button >= BUTTONS)
		return;
	if (device->haptic.info.buttons <= button)
		device->haptic.info.buttons = (uint32_t)button + 1;
	device->pressed &= ~(UINT32_C(1) << button);
	device->pressed |= (uint32_t)(state != 0) << button;
}

static void take_message(struct vrpn_device *device, enum vrpn_type type,
			 const uint8_t *payload, size_t n, int64_t utc_ns)
{
	if (types[type].n && n != types[type].n)
		return;
	if (type == VRPN_POSE)
		take_pose(device, payload, utc_ns);
	else if (type == VRPN_VELOCITY)
		take_velocity(device, payload, utc_ns);
	else if (type == VRPN_BUTTON)
		take_button(device, get_word(payload), get_word(payload + 4));
	else if (type == VRPN_FORCE_ERROR && get_word(payload) != VALUE_OUT_OF_RANGE)
		device->force_error = (int)get_word(payload);
	for (size_t at = 4; type == VRPN_BUTTONS && at + 4 <= n; at += 4)
		take_button(device, at / 4 - 1, get_word(payload + at));
}

/* 1: the cookie is there. Minor versions speak alike. */
static int take_cookie(struct vrpn_device *device)
{
	size_t n = device->n < strlen(VERSION) ? device->n : strlen(VERSION);

	if (memcmp(device->bytes, VERSION, n))
		return -EPROTO;
	device->greeted = device->n >= COOKIE;
	device->at = device->greeted ? COOKIE : 0;
	return device->greeted;
}

/* The type of the next message that is used; -1: a message that is not; -EAGAIN, -EPROTO. */
static int find_type(const struct vrpn_device *device)
{
	const uint8_t *header = device->bytes + device->at;
	size_t left = device->n - device->at;
	int type = VRPN_TYPES - 1;

	if (left < HEADER)
		return -EAGAIN;
	if (get_word(header) < HEADER || get_word(header) > VRPN_MOST)
		return -EPROTO;
	if (left < pad(get_word(header)))
		return -EAGAIN;
	while (type >= 0 && (device->sender < 0 || device->types[type] < 0 ||
			     (int32_t)get_word(header + 12) != device->sender ||
			     (int32_t)get_word(header + 16) != device->types[type]))
		type--;
	return type;
}

/* Take messages up to the next pose. 0, or the device's error. */
static int take_messages(struct vrpn_device *device)
{
	int type = device->greeted ? 0 : take_cookie(device);

	if (type < 0)
		return break_link(device, EPROTO, "does not speak VRPN 07");
	if (!device->greeted)
		return 0;
	while ((type = find_type(device)) >= -1) {
		const uint8_t *header = device->bytes + device->at;
		size_t n = get_word(header) - HEADER;
		int64_t utc_ns = get_word(header + 4) * SECOND_NS +
				 get_word(header + 8) * INT64_C(1000);

		/* It has all that has come since. */
		if (type == VRPN_POSE && device->waits)
			break;
		device->at += pad(HEADER + n);
		if (type >= 0)
			take_message(device, (enum vrpn_type)type, header + HEADER, n,
				     utc_ns);
		else if (!take_description(device, (int32_t)get_word(header + 16),
					   (int32_t)get_word(header + 12),
					   header + HEADER, n))
			return fail(device, EPROTO, "got another number");
	}
	return type == -EPROTO ? break_link(device, EPROTO,
					    "sent a message that VRPN 07 does not have")
			       : 0;
}

int vrpn_device_pose(struct vrpn_device *device, struct vrpn_pose *pose)
{
	int rc = device->haptic.error;

	/* The sample of a broken link comes before those of a new one. */
	if (!rc && !(device->waits && device->broken_ns))
		rc = take_messages(device);
	if (rc || !device->waits)
		return rc;
	if (device->forces && !device->named && device->types[VRPN_FORCE_FIELD] >= 0)
		send_names(device);
	*pose = device->last;
	pose->sample.buttons = device->pressed;
	pose->sample.flags =
		(device->force_error ? INCISE_HAPTIC_PROTECTED : 0) |
		(device->forces && !device->named ? INCISE_HAPTIC_NOT_READY : 0);
	device->waits = false;
	return 1;
}

int vrpn_device_force(struct vrpn_device *device, const double force_N[3])
{
	static const double none[3];

	device->held = device->held && v3_length(force_N) > 0;
	if (device->named && !send_field(device, device->held ? none : force_N, RADIUS_M))
		return break_link(device, EIO, "takes nothing any more");
	return 0;
}

/* --- the connection ------------------------------------------------------------------ */

static void try_again(struct vrpn_device *device)
{
	if (device->leaving)
		drop_poses(device);
	if (device->arrival_ns < device->retry_ns)
		return;
	server_link_close(&device->link);
	device->leaving = false;
	device->retry_ns = device->sound_ns = device->arrival_ns;
	device->retry_ns += RETRY_NS;
	server_link_start(&device->link);
}

/* Bytes that are there, and our cookie as soon as there is a connection. */
static int receive_bytes(struct vrpn_device *device)
{
	static const uint8_t cookie[COOKIE] = VERSION "38  0";
	size_t room = sizeof(device->bytes) - device->n;
	ssize_t n;

	if (!device->met && server_link_wait(&device->link, device->link.fd, POLLOUT, 0))
		device->met = send_bytes(device, cookie, COOKIE);
	if (!room)
		return 0;
	n = recv(device->link.fd, device->bytes + device->n, room, 0);
	if (n > 0)
		device->n += (size_t)n;
	else if (!n || (errno != EAGAIN && errno != EINTR))
		return break_link(device, ENODEV, "closed the connection");
	else if (device->arrival_ns - device->sound_ns > device->silent_ns)
		return break_link(device, EIO, "sends no poses");
	return 0;
}

int vrpn_device_receive(struct vrpn_device *device)
{
	device->n -= device->at;
	memmove(device->bytes, device->bytes + device->at, device->n);
	device->at = 0;
	device->arrival_ns = incise_monotonic_ns();
	if (device->haptic.error)
		return device->haptic.error;
	if (device->broken_ns && device->sender < 0 &&
	    device->arrival_ns - device->broken_ns > GONE_NS)
		return fail(device, ENODEV,
			    "broke its connection, and was not back after 10 s");
	if (device->link.fd >= 0 && !device->leaving)
		return receive_bytes(device);
	try_again(device);
	return 0;
}

/* --- opening ------------------------------------------------------------------------- */

static int parse_device(struct vrpn_device *device, const char *arguments,
			const char *where, struct incise_error *err)
{
	int n = (int)strcspn(arguments, "@");
	const char *rest = "";

	if (!n || n >= VRPN_NAME || !arguments[n] ||
	    server_link_parse(&device->link, arguments + n + 1, PORT, &rest) || *rest)
		return incise_error_set(
			err, EINVAL,
			"%s: \"%.80s\": expected vrpn:NAME@HOST:PORT, such as "
			"vrpn:Phantom0@localhost; correct it",
			where, arguments);
	snprintf(device->device, sizeof(device->device), "%.*s", n, arguments);
	snprintf(device->haptic.info.name, sizeof(device->haptic.info.name),
		 "VRPN %.24s at %.27s", device->device, device->link.host);
	return 0;
}

/* Whether the server has the address of this end. The port of IPv6 is in the same place. */
static bool is_own_machine(const struct server_link *link)
{
	struct sockaddr_storage own = {0};
	socklen_t n = sizeof(own);

	if (getsockname(link->fd, (struct sockaddr *)&own, &n))
		return false;
	((struct sockaddr_in *)&own)->sin_port =
		((const struct sockaddr_in *)&link->address)->sin_port;
	return !memcmp(&own, &link->address, n);
}

/* Poses of which the rate is learnt, by the sender's clock. */
struct learnt {
	int64_t first_ns, age_ns;
	int n, in_window;
	bool steady; /* as before within a tenth: none of both windows was a queue */
};

static void learn_pose(struct vrpn_device *device, const struct vrpn_pose *pose,
		       struct learnt *learnt)
{
	int64_t at_ns = pose->utc_ns ? pose->utc_ns : pose->sample.t_ns;
	double hz;

	learnt->n++;
	learnt->age_ns += device->arrival_ns - pose->sample.t_ns;
	if (!learnt->in_window++)
		learnt->first_ns = at_ns;
	if (learnt->in_window < POSES_LEAST || at_ns - learnt->first_ns < LEARN_NS)
		return;
	hz = (learnt->in_window - 1) * 1e9 / (double)(at_ns - learnt->first_ns);
	learnt->steady = fabs(hz - device->haptic.info.rate_hz) < hz / 10;
	device->haptic.info.rate_hz = hz;
	learnt->first_ns = at_ns;
	learnt->in_window = 1;
}

/* Receive until the rate is known, or it is clear that it will not be. */
static void learn_device(struct vrpn_device *device)
{
	int64_t until_ns = incise_monotonic_ns() + FIRST_NS;
	struct learnt learnt = {0};
	struct vrpn_pose pose;

	device->sound_ns = until_ns;
	while (!learnt.steady && incise_monotonic_ns() < until_ns) {
		server_link_wait(&device->link, device->link.fd, POLLIN, 100);
		if (vrpn_device_receive(device))
			return;
		while (vrpn_device_pose(device, &pose) == 1)
			learn_pose(device, &pose, &learnt);
	}
	if (!(device->haptic.info.rate_hz >= RATE_LEAST)) {
		fail(device, EIO, "sends no poses");
		return;
	}
	device->haptic.info.latency_ns = learnt.age_ns / learnt.n;
	/* The next one is the first. */
	device->last.sample.seq = UINT64_MAX;
	device->haptic.lost = 0;
	device->learnt = true;
}

static int explain_absence(const struct vrpn_device *device, const char *where,
			   struct incise_error *err)
{
	const char *name = device->haptic.info.name;

	if (device->greeted && device->sender < 0)
		return incise_error_set(
			err, ENODEV,
			"%s: %s: its server has no device of that name; correct the name",
			where, name);
	if (device->haptic.error)
		return incise_error_set(err, -device->haptic.error, "%s: %s", where,
					device->haptic.cause);
	if (device->forces && device->types[VRPN_FORCE_FIELD] < 0)
		return incise_error_set(err, ENODEV,
					"%s: %s takes no force; use it as `tracker`",
					where, name);
	return 0;
}

void vrpn_device_free(struct vrpn_device *device)
{
	const struct server_link *link = &device->link;

	end_force(device);
	for (int i = 0; i < CLOSE_MS && device->leaving && drop_poses(device); i++)
		server_link_wait(link, link->fd, POLLIN, 1);
	server_link_close(&device->link);
	free(device);
}

struct vrpn_device *vrpn_device_new(const struct incise_backend_request *request,
				    uint32_t sensors, int64_t silent_ns, bool forces,
				    struct incise_error *err)
{
	const char *where = request->where;
	struct vrpn_device *device = incise_device_new(sizeof(*device), where, err);
	int rc;

	if (!device)
		return NULL;
	vrpn_device_init(device, sensors, silent_ns);
	device->forces = forces;
	rc = parse_device(device, request->arguments, where, err);
	if (!rc)
		rc = server_link_find(&device->link, "VRPN", where, err);
	if (!rc) {
		device->own_machine = is_own_machine(&device->link);
		learn_device(device);
		rc = explain_absence(device, where, err);
	}
	if (!rc)
		return device;
	vrpn_device_free(device);
	errno = -rc;
	return NULL;
}
