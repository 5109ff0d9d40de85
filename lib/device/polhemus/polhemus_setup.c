// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Setting up a tracker in the language of its family; see polhemus_setup.h.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "polhemus_dialogue.h"
#include "polhemus_setup.h"

#define NEAR 0.02   /* printed numbers have two to four decimals */
#define ALIGNMENT 9 /* numbers of it */

/* Bit 0 is station 1. */
static uint8_t mask_of(const struct incise_tracker_setup *setup)
{
	uint8_t mask = 0;

	for (int i = 0; i < setup->n_stations; i++)
		mask |= (uint8_t)(1 << (setup->stations[i] - 1));
	return mask;
}

/* Whether the bytes in @d are one record of each station, in their order. */
static bool fits_polhemus_setup(const struct polhemus_dialogue *d,
				const struct incise_tracker_setup *setup,
				const struct polhemus_layout *layout, int total)
{
	size_t length = polhemus_layout_length(layout);
	struct polhemus_record record;

	if (total != (int)length * setup->n_stations)
		return false;
	for (int i = 0; i < setup->n_stations; i++)
		if (!polhemus_record_read(layout, d->bytes + (size_t)i * length,
					  &record) ||
		    record.station != setup->stations[i])
			return false;
	return true;
}

/*
 * Ask for one record of each station with P, which confirms the setup. The length of a
 * FASTRAK's switch, which its manual does not give, is found by it.
 */
static int measure_polhemus_setup(struct polhemus_dialogue *d,
				  const struct incise_tracker_setup *setup,
				  struct polhemus_layout *layout)
{
	static const uint8_t lengths[] = {1, 2, 4};
	int rc = polhemus_say(d, "P"), total;

	if (rc)
		return rc;
	total = polhemus_collect(d);
	if (total < 0)
		return total;
	for (size_t i = 0; i < sizeof(lengths); i++) {
		layout->switch_bytes = lengths[i];
		if (fits_polhemus_setup(d, setup, layout, total))
			return 0;
	}
	return incise_error_set(
		d->err, EIO,
		"%s: the tracker at %s answers P with %d bytes, which are not one "
		"record of each of its %d stations; check its sensors",
		d->where, d->line->name, total, setup->n_stations);
}

/* Note the values of a setting that alters poses: of an alignment the origin, a point of +x, one of +y. */
static void note_setting(struct polhemus_identity *identity, int station, char command,
			 const double *values, int n)
{
	char *note = identity->note;
	size_t size = sizeof(identity->note), used = strlen(note);
	bool usual = true;

	for (int i = 0; i < n; i++)
		usual &= n == ALIGNMENT && (i == 3 || i == 7) ? values[i] > 0
							      : fabs(values[i]) <= NEAR;
	if (usual)
		return;
	used += (size_t)snprintf(
		note + used, size - used, "%s%c%d",
		used ? "; " : "settings of the tracker alter its poses: ", command,
		station);
	for (int i = 0; i < n && used < size; i++)
		used += (size_t)snprintf(note + used, size - used, " %.6g", values[i]);
}

/*
 * Ask for a setting of @n numbers. An old tracker may refuse the question, or not answer: then
 * nothing is noted.
 */
static int ask_setting(struct polhemus_dialogue *d, struct polhemus_identity *identity,
		       int station, char command, int n)
{
	char question[8], reply[POLHEMUS_REPLY_MAX];
	struct polhemus_frame frame = {0};
	double values[ALIGNMENT];
	int rc, m = 0;

	snprintf(question, sizeof(question), "%c%d\r", command, station);
	if (identity->layout.family == POLHEMUS_FASTRAK) {
		rc = polhemus_ask(d, question, command, reply);
		if (!rc)
			m = polhemus_reply_numbers(reply, values, n);
	} else {
		rc = polhemus_ask_frame(d, question, (unsigned char)command, &frame);
		for (; !rc && m < n && frame.n >= (size_t)(m + 1) * 4; m++)
			values[m] = polhemus_real(frame.payload + (size_t)m * 4);
	}
	if (rc == -EINVAL && d->err)
		*d->err = (struct incise_error){0};
	if (m == n)
		note_setting(identity, station, command, values, n);
	return rc == -EINVAL || rc == -ETIMEDOUT ? 0 : rc;
}

static int ask_settings(struct polhemus_dialogue *d,
			const struct incise_tracker_setup *setup,
			struct polhemus_identity *identity)
{
	const char *commands =
		identity->layout.family == POLHEMUS_FASTRAK ? "ArGN" : "AN";
	int rc = 0;

	for (int i = 0; i < setup->n_stations; i++)
		for (const char *c = commands; *c && !rc; c++)
			rc = ask_setting(d, identity, setup->stations[i], *c,
					 *c == 'A' ? ALIGNMENT : 3);
	return rc;
}

/*
 * --- FASTRAK ---
 *
 * For each command see chapter 9 of its manual. All is read back in ASCII; records are
 * binary.
 */

static const int items[] = {2, 11, 16, 1};
#define ITEMS ((int)(sizeof(items) / sizeof(*items)))

static int fastrak_identify(struct polhemus_dialogue *d,
			    struct polhemus_identity *identity)
{
	struct polhemus_status status;
	int rc = polhemus_ask_status(d, &status);

	if (rc)
		return rc;
	identity->sensors = status.sensors;
	identity->test_error = status.test_error;
	snprintf(identity->version, sizeof(identity->version), "%s", status.version);
	snprintf(identity->name, sizeof(identity->name), "FASTRAK %s %s", status.version,
		 status.id);
	return 0;
}

/*
 * Send a command, then a question whose answer must be @values; @width of a field, or 0.
 */
static int fastrak_put(struct polhemus_dialogue *d, const char *command,
		       const char *question, int width, const double *values, int n,
		       const char *what)
{
	char reply[POLHEMUS_REPLY_MAX];
	double got[8] = {0};
	int fields[8] = {0}, m, rc = polhemus_say(d, command);

	if (!rc)
		rc = polhemus_ask(d, question, question[0], reply);
	if (rc == -ETIMEDOUT)
		return polhemus_not_taken(d, what, "");
	if (rc)
		return rc;
	if (width) {
		m = polhemus_reply_fields(reply, width, fields, 8);
		for (int i = 0; i < m; i++)
			got[i] = fields[i];
	} else {
		m = polhemus_reply_numbers(reply, got, 8);
	}
	for (int i = 0; i < n; i++)
		if (m < n || !(fabs(got[i] - values[i]) <= NEAR))
			return polhemus_not_taken(d, what, reply);
	/* More items would make longer records. */
	return width == 2 && m != n ? polhemus_not_taken(d, what, reply) : 0;
}

/* A station that should be on and is off. */
static int no_sensor(struct polhemus_dialogue *d, int station)
{
	return incise_error_set(
		d->err, EIO,
		"%s: station %d of the tracker at %s does not switch on; plug in its "
		"sensor and set its switch, or remove it from tracker_setup",
		d->where, station, d->line->name);
}

/* Switch on first: the last active station cannot be switched off. */
static int fastrak_stations(struct polhemus_dialogue *d, uint8_t mask)
{
	char reply[POLHEMUS_REPLY_MAX], command[8];
	int fields[POLHEMUS_STATIONS], rc = 0;

	for (int on = 1; on >= 0; on--)
		for (int i = 0; !rc && i < POLHEMUS_STATIONS; i++)
			if ((mask >> i & 1) == on) {
				snprintf(command, sizeof(command), "l%d,%d\r", i + 1, on);
				rc = polhemus_say(d, command);
			}
	if (!rc)
		rc = polhemus_ask(d, "l1\r", 'l', reply);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, "its stations", "") : rc;
	if (polhemus_reply_fields(reply, 1, fields, POLHEMUS_STATIONS) !=
	    POLHEMUS_STATIONS)
		return polhemus_not_taken(d, "its stations", reply);
	/* If all of these are off, another one stays on. */
	for (int i = 0; i < POLHEMUS_STATIONS; i++)
		if (mask >> i & 1 && !fields[i])
			return no_sensor(d, i + 1);
	for (int i = 0; i < POLHEMUS_STATIONS; i++)
		if (fields[i] && !(mask >> i & 1))
			return polhemus_not_taken(d, "its stations", reply);
	return 0;
}

static int set_station(struct polhemus_dialogue *d, int station,
		       const double hemisphere[3])
{
	static const double still[] = {0};
	char command[64], question[8];
	double list[ITEMS];
	int rc;

	for (int i = 0; i < ITEMS; i++)
		list[i] = items[i];
	snprintf(command, sizeof(command), "O%d,2,11,16,1\r", station);
	snprintf(question, sizeof(question), "O%d\r", station);
	rc = fastrak_put(d, command, question, 2, list, ITEMS, "its list of items");
	if (rc)
		return rc;
	snprintf(command, sizeof(command), "I%d,0\r", station);
	snprintf(question, sizeof(question), "I%d\r", station);
	rc = fastrak_put(d, command, question, 0, still, 1, "an increment of 0");
	if (rc)
		return rc;
	snprintf(command, sizeof(command), "H%d,%.4f,%.4f,%.4f\r", station, hemisphere[0],
		 hemisphere[1], hemisphere[2]);
	snprintf(question, sizeof(question), "H%d\r", station);
	return fastrak_put(d, command, question, 0, hemisphere, 3, "its hemisphere");
}

static int set_sync(struct polhemus_dialogue *d, enum incise_tracker_sync sync)
{
	const double is[] = {(double)sync};
	char command[8];

	snprintf(command, sizeof(command), "y%d\r", (int)sync);
	return fastrak_put(d, command, "y\r", 0, is, 1, "its sync mode");
}

static int fastrak_setup(struct polhemus_dialogue *d,
			 const struct incise_tracker_setup *setup,
			 struct polhemus_identity *identity)
{
	static const double unfiltered[] = {0, 1, 0, 0};
	struct polhemus_status status;
	int rc = polhemus_say(d, "Fu");

	if (!rc)
		rc = fastrak_identify(d, identity);
	if (!rc)
		rc = fastrak_stations(d, mask_of(setup));
	for (int i = 0; !rc && i < setup->n_stations; i++)
		rc = set_station(d, setup->stations[i], setup->hemisphere);
	if (!rc)
		rc = ask_settings(d, setup, identity);
	if (!rc)
		rc = fastrak_put(d, "x0,1,0,0\r", "x\r", 0, unfiltered, 4,
				 "no position filter");
	if (!rc)
		rc = fastrak_put(d, "v0,1,0,0\r", "v\r", 0, unfiltered, 4,
				 "no attitude filter");
	/* Internal sync for now: without pulses it may not answer P. */
	if (!rc)
		rc = set_sync(d, INCISE_TRACKER_INTERNAL);
	/* The button mode cannot be read back, but a refusal would precede the status. */
	if (!rc)
		rc = polhemus_say(d, "e1,0\rf");
	if (!rc)
		rc = polhemus_ask_status(d, &status);
	if (rc)
		return rc;
	if (!status.binary || !status.centimetres || status.continuous)
		return polhemus_not_taken(d,
					  !status.binary	? "binary output"
					  : !status.centimetres ? "centimetres"
								: "an end of its records",
					  "the status S");
	identity->layout = (struct polhemus_layout){.family = POLHEMUS_FASTRAK,
						    .stations = mask_of(setup)};
	rc = measure_polhemus_setup(d, setup, &identity->layout);
	if (!rc && setup->sync != INCISE_TRACKER_INTERNAL)
		rc = set_sync(d, setup->sync);
	return rc ? rc : polhemus_say(d, "C");
}

/*
 * --- LIBERTY and PATRIOT ---
 *
 * They answer in frames once F1 is set; numbers have 32 bits, float or integer,
 * little-endian. Items 2 xyz, 7 quaternion, 9 count of frames, 10 stylus. (LIBERTY user
 * manual, rev. H; PATRIOT, rev. J.)
 */

enum { CONTROL_U = 'U' & 31, CONTROL_V = 'V' & 31 };

static int liberty_identify(struct polhemus_dialogue *d,
			    struct polhemus_identity *identity)
{
	struct polhemus_frame frame;
	char text[48] = {0};
	size_t n = 0;
	/* The CR ends a command for a FASTRAK; the answer to that is still text. */
	int rc = polhemus_say(d, "\rF1\r");

	if (!rc)
		rc = polhemus_drain(d);
	if (rc == -EBUSY)
		return -ETIMEDOUT; /* an endless stream is no answer */
	if (!rc)
		rc = polhemus_ask_frame(d, "\026\r", CONTROL_V, &frame);
	if (rc)
		return rc;
	for (size_t i = 0; i < frame.n && n + 1 < sizeof(text); i++)
		if (frame.payload[i] > ' ' || (frame.payload[i] == ' ' && n))
			text[n++] =
				frame.payload[i] <= '~' ? (char)frame.payload[i] : '?';
	identity->layout.family = (enum polhemus_family)frame.family;
	identity->sensors = -1;
	snprintf(identity->name, sizeof(identity->name), "%s %s",
		 polhemus_family_name(identity->layout.family), text);
	return 0;
}

/* Send a command, then a question whose answer must begin with @values. */
static int liberty_put(struct polhemus_dialogue *d, const char *command,
		       const char *question, bool reals, const double *values, int n,
		       const char *what)
{
	struct polhemus_frame frame;
	int rc = polhemus_say(d, command);

	if (!rc)
		rc = polhemus_ask_frame(d, question, (unsigned char)question[0], &frame);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, what, "") : rc;
	for (int i = 0; i < n; i++) {
		const unsigned char *at = frame.payload + (size_t)i * 4;
		double got;

		if (frame.n < (size_t)(i + 1) * 4)
			return polhemus_not_taken(d, what, "a short answer");
		got = reals ? polhemus_real(at) : (double)polhemus_word(at);
		if (!(fabs(got - values[i]) <= NEAR))
			return polhemus_not_taken(d, what, "something else");
	}
	return 0;
}

/* The answer has the detected and the active stations, 16 or 32 bits each. */
static int liberty_stations(struct polhemus_dialogue *d, uint8_t mask)
{
	struct polhemus_frame frame;
	char command[12];
	uint32_t active;
	int rc = 0;

	for (int on = 1; on >= 0; on--)
		for (int i = 0; !rc && i < POLHEMUS_STATIONS; i++) {
			/* A PATRIOT has two stations, and refuses others. */
			if ((mask >> i & 1) != on)
				continue;
			snprintf(command, sizeof(command), "\025%d,%d\r", i + 1, on);
			if (on)
				rc = polhemus_say(d, command);
			else if (!(rc = polhemus_say(d, command)))
				rc = polhemus_drain(d);
		}
	if (rc == -EBUSY)
		return polhemus_not_taken(d, "its stations", "more and more");
	if (!rc)
		rc = polhemus_ask_frame(d, "\0250\r", CONTROL_U, &frame);
	if (rc)
		return rc == -ETIMEDOUT ? polhemus_not_taken(d, "its stations", "") : rc;
	if (frame.n < 4)
		return polhemus_not_taken(d, "its stations", "a short answer");
	active = frame.n >= 8 ? polhemus_word(frame.payload + 4)
			      : polhemus_word(frame.payload) >> 16;
	for (int i = 0; i < POLHEMUS_STATIONS; i++)
		if (mask & ~active & 1u << i)
			return no_sensor(d, i + 1);
	if ((active & 0xf) == mask)
		return 0;
	snprintf(command, sizeof(command), "%#x", (unsigned int)active & 0xf);
	return polhemus_not_taken(d, "its stations", command);
}

static int liberty_setup(struct polhemus_dialogue *d,
			 const struct incise_tracker_setup *setup,
			 struct polhemus_identity *identity)
{
	static const double one[] = {1}, fastest[] = {4}, unfiltered[] = {0, 1, 0, 0};
	char command[64], question[8];
	int rc = liberty_identify(d, identity);
	bool liberty;

	if (rc)
		return rc;
	if (setup->sync != INCISE_TRACKER_INTERNAL)
		return incise_error_set(
			d->err, EINVAL,
			"%s: only a FASTRAK supports external sync; set sync = "
			"\"internal\" in tracker_setup",
			d->where);
	liberty = identity->layout.family == POLHEMUS_LIBERTY;
	rc = liberty_put(d, "U1\r", "U\r", false, one, 1, "centimetres");
	if (!rc && liberty)
		rc = liberty_put(d, "R4\r", "R\r", false, fastest, 1, "240 Hz");
	if (!rc)
		rc = liberty_stations(d, mask_of(setup));
	for (int i = 0; !rc && i < setup->n_stations; i++) {
		int station = setup->stations[i];

		snprintf(command, sizeof(command), "O%d,2,7,9,10\rL%d,0\r", station,
			 station);
		rc = polhemus_say(d, command);
		snprintf(command, sizeof(command), "H%d,%.4f,%.4f,%.4f\r", station,
			 setup->hemisphere[0], setup->hemisphere[1],
			 setup->hemisphere[2]);
		snprintf(question, sizeof(question), "H%d\r", station);
		if (!rc)
			rc = liberty_put(d, command, question, true, setup->hemisphere, 3,
					 "its hemisphere");
	}
	if (!rc)
		rc = ask_settings(d, setup, identity);
	if (!rc)
		rc = liberty_put(d, "X0,1,0,0\r", "X\r", true, unfiltered, 4,
				 "no position filter");
	if (!rc)
		rc = liberty_put(d, "Y0,1,0,0\r", "Y\r", true, unfiltered, 4,
				 "no attitude filter");
	if (rc)
		return rc;
	identity->layout.stations = mask_of(setup);
	rc = measure_polhemus_setup(d, setup, &identity->layout);
	return rc ? rc : polhemus_say(d, "C\r");
}

/* --- both --- */

#define STOPS 10

/* USB has no baud rate, and its cable one way to be plugged in. */
static bool is_serial(const struct polhemus_dialogue *d)
{
	return d->line->ns_per_byte > 0;
}

static int no_answer(struct polhemus_dialogue *d)
{
	return incise_error_set(
		d->err, ETIMEDOUT, "%s: no tracker answers at %s; %s", d->where,
		d->line->name,
		is_serial(d) ? "switch it on, set the baud rate of its switches, and "
			       "use a null modem cable"
			     : "switch it off and on, wait 20 s until it has started, "
			       "and plug its USB cable in again");
}

/*
 * Stop any stream. CR ends an incomplete command, c the stream of a FASTRAK, P the stream
 * of the others. For those, c and CR start a stream; a FASTRAK answers P with records.
 * All answers are dropped.
 */
static int quiet(struct polhemus_dialogue *d)
{
	const char *stop = d->line->family == POLHEMUS_FASTRAK ? "\rc"
			   : d->line->family >= 0	       ? "\rP"
							       : "\rc\rP";
	int rc = -EBUSY;

	/* Repeatedly: a tracker that was just switched on may miss the first. */
	for (int i = 0; rc == -EBUSY && i < STOPS; i++) {
		rc = polhemus_say(d, stop);
		if (!rc)
			rc = polhemus_drain(d);
	}
	if (rc == -EBUSY)
		incise_error_set(
			d->err, EBUSY, "%s: the device at %s does not stop sending; %s",
			d->where, d->line->name,
			is_serial(d)
				? "name the line of a Polhemus tracker, and its baud "
				  "rate"
				: "name a Polhemus tracker, or switch it off and on");
	return rc;
}

/* The family as the line gives it, or by asking. */
static int find_family(struct polhemus_dialogue *d, struct polhemus_identity *identity)
{
	int rc = d->line->family;

	if (rc >= 0) {
		identity->layout.family = (enum polhemus_family)rc;
		return 0;
	}
	identity->layout.family = POLHEMUS_FASTRAK;
	rc = fastrak_identify(d, identity);
	if (rc != -ETIMEDOUT && rc != -EINVAL)
		return rc;
	return liberty_identify(d, identity);
}

static int identify(struct polhemus_dialogue *d, struct polhemus_identity *identity)
{
	int rc = -ETIMEDOUT;

	/* Again if bytes came: a late answer to quiet() may have spoilt the first answer. */
	for (int i = 0; rc == -ETIMEDOUT && (!i || (i == 1 && d->first_ns)); i++) {
		memset(identity, 0, sizeof(*identity));
		rc = quiet(d);
		rc = rc ? rc : find_family(d, identity);
	}
	return rc;
}

int polhemus_setup(struct polhemus_line *line, const struct incise_tracker_setup *setup,
		   struct polhemus_identity *identity, const char *where,
		   struct incise_error *err)
{
	struct polhemus_dialogue d = {.line = line, .where = where, .err = err};
	int rc = identify(&d, identity);

	if (!rc && identity->layout.family == POLHEMUS_FASTRAK)
		rc = fastrak_setup(&d, setup, identity);
	else if (!rc)
		rc = liberty_setup(&d, setup, identity);
	return rc == -ETIMEDOUT ? no_answer(&d) : rc;
}

int polhemus_identify(struct polhemus_line *line, struct polhemus_identity *identity,
		      const char *where, struct incise_error *err)
{
	struct polhemus_dialogue d = {.line = line, .where = where, .err = err};
	int rc = identify(&d, identity);

	return rc == -ETIMEDOUT ? no_answer(&d) : rc;
}

void polhemus_stop(struct polhemus_line *line, enum polhemus_family family)
{
	struct polhemus_dialogue d = {.line = line, .where = ""};

	if (!polhemus_say(&d, family == POLHEMUS_FASTRAK ? "c" : "P"))
		polhemus_drain(&d);
}
