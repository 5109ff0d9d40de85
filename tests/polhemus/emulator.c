// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A tracker that is not there; see emulator.h.
 */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "emulator.h"

static const char *id = "OutputCompensat CPG2030-003-10";

static uint32_t draw(struct emulator *e)
{
	/* xorshift64* */
	e->random ^= e->random >> 12;
	e->random ^= e->random << 25;
	e->random ^= e->random >> 27;
	return (uint32_t)((e->random * UINT64_C(2685821657736338717)) >> 32);
}

static bool happens(struct emulator *e, unsigned int millionths)
{
	return millionths && draw(e) % 1000000 < millionths;
}

void emulator_init(struct emulator *e, enum emulator_kind kind, int64_t now_ns)
{
	memset(e, 0, sizeof(*e));
	e->kind = kind;
	e->present[0] = e->on[0] = true;
	e->switch_bytes = 1;
	e->hz = kind == EMULATOR_FASTRAK ? 120 : kind == EMULATOR_LIBERTY ? 240 : 60;
	e->random = 88172645463325252;
	for (int i = 0; i < EMULATOR_STATIONS; i++) {
		e->items[i][0] = 2;
		e->items[i][1] = 4;
		e->items[i][2] = 1;
		e->n_items[i] = 3;
		e->hemisphere[i][0] = 1;
		e->alignment[i][3] = e->alignment[i][7] = 200;
	}
	/* As somebody left it: filters on, and an increment that holds records back. */
	for (int i = 0; i < 2; i++)
		memcpy(e->filters[i], (double[]){0.2, 0.2, 0.8, 0.8},
		       sizeof(e->filters[i]));
	e->increment[0] = 2;
	e->start_ns = e->now_ns = now_ns;
}

void emulator_free(struct emulator *e)
{
	free(e->sent);
	e->sent = NULL;
}

struct emulator_pose emulator_pose(uint64_t slot, int station)
{
	struct emulator_pose pose = {.error = slot % 397 == 5 ? 'x' : ' '};
	double t = (double)slot / 120, turn = 0.3 * t + station,
	       tilt = 0.4 + 0.2 * sin(t);
	static const unsigned char header[4] = {'0', '1', ' ', 'A'}; /* 10.012 */

	pose.xyz_cm[0] = (float)(12 + 3 * sin(1.1 * t) + station);
	pose.xyz_cm[1] = (float)(2 * cos(0.7 * t));
	pose.xyz_cm[2] = (float)(-4 + sin(2.3 * t));
	/* A float that looks like a header, at many places. */
	if (slot % 5 == 0)
		memcpy(&pose.xyz_cm[slot % 3], header, 4);
	pose.q[0] = (float)cos(turn / 2);
	pose.q[1] = (float)(sin(turn / 2) * sin(tilt));
	pose.q[2] = 0;
	pose.q[3] = (float)(sin(turn / 2) * cos(tilt));
	pose.button = station == 1 && slot / 60 % 4 == 3;
	return pose;
}

static void reply_bytes(struct emulator *e, const void *bytes, size_t n)
{
	if (n > EMULATOR_ROOM - e->n_replies)
		n = EMULATOR_ROOM - e->n_replies;
	if (n)
		memcpy(e->replies + e->n_replies, bytes, n);
	e->n_replies += n;
}

__attribute__((format(printf, 2, 3))) static void reply(struct emulator *e,
							const char *form, ...)
{
	char text[300];
	va_list args;
	int n;

	va_start(args, form);
	n = vsnprintf(text, sizeof(text), form, args);
	va_end(args);
	reply_bytes(e, text, (size_t)n);
	reply_bytes(e, "\r\n", 2);
}

static void reply_frame(struct emulator *e, int station, char command, char error,
			const void *payload, size_t n)
{
	unsigned char header[8] = {'L', 'Y', 0, 0, 0, 0, 0, 0};

	if (e->kind == EMULATOR_PATRIOT)
		memcpy(header, "PA", 2);
	header[2] = (unsigned char)station;
	header[3] = (unsigned char)command;
	header[4] = (unsigned char)error;
	header[6] = (unsigned char)n;
	header[7] = (unsigned char)(n >> 8);
	reply_bytes(e, header, 8);
	reply_bytes(e, payload, n);
}

static void error(struct emulator *e, int code)
{
	e->errors++;
	if (e->kind == EMULATOR_FASTRAK)
		reply(e, "2 E*ERROR*%s*ERROR* EC %d*PS 0*FL 0*ST 0", e->command, code);
	else if (e->binary)
		reply_frame(e, 1, e->command[0], 'a', NULL, 0);
	else
		reply(e, "00%caInvalid command", e->command[0] ? e->command[0] : ' ');
}

static size_t append(unsigned char *to, const void *from, size_t n)
{
	memcpy(to, from, n);
	return n;
}

static size_t item(const struct emulator *e, int what, const struct emulator_pose *pose,
		   unsigned char *to)
{
	float scale = e->cm ? 1 : 1 / 2.54F, xyz[3];
	uint32_t pressed = pose->button;

	for (int i = 0; i < 3; i++)
		xyz[i] = pose->xyz_cm[i] * scale;
	switch (what) {
	case 0:
		return append(to, " ", 1);
	case 1:
		return append(to, "\r\n", 2);
	case 2:
		if (e->binary)
			return append(to, xyz, 12);
		return (size_t)sprintf((char *)to, "%7.2f%7.2f%7.2f", (double)xyz[0],
				       (double)xyz[1], (double)xyz[2]);
	case 11:
		if (e->binary)
			return append(to, pose->q, 16);
		return (size_t)sprintf((char *)to, "%7.4f%7.4f%7.4f%7.4f",
				       (double)pose->q[0], (double)pose->q[1],
				       (double)pose->q[2], (double)pose->q[3]);
	case 16:
		if (e->switch_bytes == 4 && e->binary)
			return append(to, &pressed, 4);
		to[0] = ' ';
		to[e->switch_bytes - 1] = pressed ? '1' : '0';
		return (size_t)e->switch_bytes;
	default: /* angles, which nobody reads */
		memset(to, '0', 12);
		return 12;
	}
}

/* A record as it leaves the device. */
static size_t record(const struct emulator *e, uint64_t slot, int station, char command,
		     unsigned char *to)
{
	struct emulator_pose pose =
		emulator_pose(e->frozen ? e->frozen_slot : slot, station);
	uint32_t frame = (uint32_t)slot, pressed = pose.button;
	size_t n = 0;

	if (e->flag)
		pose.error = e->flag;
	if (e->kind == EMULATOR_FASTRAK) {
		to[n++] = '0';
		to[n++] = (unsigned char)('0' + station);
		to[n++] = (unsigned char)pose.error;
		for (int i = 0; i < e->n_items[station - 1]; i++)
			n += item(e, e->items[station - 1][i], &pose, to + n);
		return n;
	}
	memcpy(to, e->kind == EMULATOR_LIBERTY ? "LY" : "PA", 2);
	to[2] = (unsigned char)station;
	to[3] = (unsigned char)command;
	to[4] = pose.error == ' ' ? 0 : (unsigned char)pose.error;
	to[5] = 0;
	n = 8;
	for (int i = 0; i < e->n_items[station - 1]; i++)
		switch (e->items[station - 1][i]) {
		case 2:
			n += item(e, 2, &pose, to + n);
			break;
		case 7:
			n += append(to + n, pose.q, 16);
			break;
		case 9:
			n += append(to + n, &frame, 4);
			break;
		case 10:
			n += append(to + n, &pressed, 4);
			break;
		default:
			n += append(to + n, "\0\0\0\0", 4);
		}
	to[6] = (unsigned char)(n - 8);
	to[7] = 0;
	return n;
}

static void put_byte(struct emulator *e, unsigned char byte)
{
	if (e->n_records < EMULATOR_ROOM)
		e->records[e->n_records++] = byte;
}

static void send_record(struct emulator *e, uint64_t slot, int station)
{
	const struct emulator_damage *d = &e->damage;
	bool harm = slot >= d->from && slot < d->to, touched = false;
	unsigned char bytes[300];
	size_t n = record(e, slot, station, 'C', bytes);

	if (harm && happens(e, d->lose)) {
		touched = true;
		n = 0;
	}
	/* As a buffer that is full takes none of it. */
	if (n > EMULATOR_ROOM - e->n_records) {
		touched = true;
		n = 0;
	}
	for (size_t i = 0; i < n; i++) {
		unsigned char byte = bytes[i];

		if (harm && happens(e, d->insert)) {
			put_byte(e, (unsigned char)draw(e));
			/* Before the first byte is between records. */
			touched |= i > 0;
		}
		if (harm && happens(e, d->drop)) {
			touched = true;
			continue;
		}
		if (harm && happens(e, d->flip)) {
			byte ^= (unsigned char)(1 + draw(e) % 255);
			touched = true;
		}
		put_byte(e, byte);
	}
	if (e->n_sent == e->capacity_sent) {
		e->capacity_sent = e->capacity_sent ? 2 * e->capacity_sent : 1024;
		e->sent = realloc(e->sent, e->capacity_sent * sizeof(*e->sent));
		if (!e->sent)
			abort();
	}
	e->sent[e->n_sent++] =
		(struct emulator_sent){slot, e->now_ns, (uint8_t)station, touched};
}

static int next_station(const struct emulator *e, int from)
{
	for (int i = 0; i < EMULATOR_STATIONS; i++) {
		int station = (from + i) % EMULATOR_STATIONS + 1;

		if (e->on[station - 1])
			return station;
	}
	return 1;
}

int64_t emulator_next_ns(const struct emulator *e)
{
	return e->continuous
		       ? e->start_ns + (int64_t)((double)(e->slot + 1) * 1e9 / e->hz)
		       : INT64_MAX;
}

/* A period ends: what was measured in it goes out. */
static void cycle(struct emulator *e)
{
	bool button = emulator_pose(e->slot, 1).button && e->on[0];

	/* Unless it is set to be a mouse's, the button ends and starts a stream. */
	if (!e->continuous)
		e->paused = false;
	else if (button && !e->pressed && !e->mouse)
		e->paused = !e->paused;
	e->pressed = button;
	if (!e->continuous || e->paused)
		return;
	if (e->kind == EMULATOR_FASTRAK) {
		int station = next_station(e, e->turn);

		e->turn = station % EMULATOR_STATIONS;
		/* One that did not move far enough is left out. */
		if (e->increment[station - 1] <= 0)
			send_record(e, e->slot, station);
		return;
	}
	for (int i = 0; i < EMULATOR_STATIONS; i++)
		if (e->on[i])
			send_record(e, e->slot, i + 1);
}

void emulator_advance(struct emulator *e, int64_t now_ns)
{
	for (;;) {
		int64_t next_ns =
			e->start_ns + (int64_t)((double)(e->slot + 1) * 1e9 / e->hz);

		if (next_ns > now_ns)
			break;
		e->now_ns = next_ns;
		cycle(e);
		e->slot++;
	}
	e->now_ns = now_ns;
}

static void point(struct emulator *e)
{
	unsigned char bytes[300];

	if (e->kind != EMULATOR_FASTRAK)
		e->continuous = false;
	/* Nobody gives it pulses before it streams. */
	if (e->sync)
		return;
	for (int i = 0; i < EMULATOR_STATIONS; i++)
		if (e->on[i])
			reply_bytes(e, bytes, record(e, e->slot, i + 1, 'P', bytes));
}

static void status(struct emulator *e)
{
	int flags = 0x3f0 | e->binary | e->cm << 1 | e->continuous << 3, sensors = 0;

	for (int i = 0; i < EMULATOR_STATIONS; i++)
		sensors |= e->present[i] << i;
	reply(e, "21S%03X    F3%X  %-6s%-32s", (unsigned int)flags, (unsigned int)sensors,
	      "3.02", id);
}

static bool is_stuck(const struct emulator *e, char c)
{
	return e->stuck && strchr(e->stuck, c);
}

/* Commands of one character; false: it is none. */
static bool at_once(struct emulator *e, char c)
{
	if (c == ('K' & 31)) {
		e->eeprom_writes++;
		return true;
	}
	if (c == 'P') {
		point(e);
		return true;
	}
	if (e->kind != EMULATOR_FASTRAK)
		return false;
	if (!strchr("CcFfUuS", c))
		return false;
	if (is_stuck(e, c))
		return true;
	switch (c) {
	case 'C':
		e->continuous = true;
		e->turn = 0;
		break;
	case 'c':
		e->continuous = false;
		break;
	case 'F':
	case 'f':
		e->binary = c == 'f';
		break;
	case 'U':
	case 'u':
		e->cm = c == 'u';
		break;
	default:
		status(e);
	}
	return true;
}

/* Numbers of a command behind its first character; -1: there is something else. */
static int numbers(const char *text, double *values, int most)
{
	int n = 0;

	while (*text) {
		char *end;

		if (n == most)
			return -1;
		values[n++] = strtod(text, &end);
		if (end == text || (*end && *end != ','))
			return -1;
		text = *end ? end + 1 : end;
	}
	return n;
}

static bool is_station(double value)
{
	return value >= 1 && value <= EMULATOR_STATIONS && value == floor(value);
}

static void switch_station(struct emulator *e, int i, bool on)
{
	int count = 0;

	for (int j = 0; j < EMULATOR_STATIONS; j++)
		count += e->on[j];
	/* The last one stays, and one without a sensor does not begin. */
	if (on ? e->present[i] : count > 1)
		e->on[i] = on;
}

static void set_items(struct emulator *e, int i, const double *v, int n)
{
	e->n_items[i] = n;
	for (int j = 0; j < n; j++)
		e->items[i][j] = (int)v[j];
}

/* Numbers that follow each other without a blank, if they are as long as their fields. */
static void reply_list(struct emulator *e, int station, char c, const double *v, int n,
		       const char *form)
{
	char text[100] = "";

	for (int j = 0; j < n; j++)
		snprintf(text + strlen(text), sizeof(text) - strlen(text), form, v[j]);
	reply(e, "2%d%c%s", station, c, text);
}

static void fastrak_command(struct emulator *e)
{
	static const char of_a_station[] = "OHIleABGNr";
	char c = e->command[0];
	double v[EMULATOR_ITEMS + 1];
	int n, i;

	if (!c || (!strchr("xvy", c) && !strchr(of_a_station, c))) {
		error(e, -99);
		return;
	}
	n = numbers(e->command + 1, v, EMULATOR_ITEMS + 1);
	if (n < 0) {
		error(e, -2);
		return;
	}
	if (strchr(of_a_station, c) && (n < 1 || !is_station(v[0]))) {
		error(e, n < 1 ? -1 : -3);
		return;
	}
	i = n && strchr(of_a_station, c) ? (int)v[0] - 1 : 0;
	if (is_stuck(e, c) && n > (strchr("xvy", c) ? 0 : 1))
		return;
	switch (c) {
	case 'O':
		if (n > 1) {
			set_items(e, i, v + 1, n - 1);
			break;
		}
		{
			char text[EMULATOR_ITEMS * 2 + 1] = "";

			for (int j = 0; j < e->n_items[i]; j++)
				sprintf(text + 2 * (size_t)j, "%2d",
					e->items[i][j] % 100);
			reply(e, "2%dO%s", i + 1, text);
		}
		break;
	case 'H':
		if (n == 4)
			memcpy(e->hemisphere[i], v + 1, sizeof(e->hemisphere[i]));
		else if (n == 1)
			reply(e, "2%dH%7.2f%7.2f%7.2f", i + 1, e->hemisphere[i][0],
			      e->hemisphere[i][1], e->hemisphere[i][2]);
		else
			error(e, -1);
		break;
	case 'A':
		reply_list(e, i + 1, c, e->alignment[i], 9, "%7.2f");
		break;
	case 'B':
		e->boresights++;
		break;
	case 'G':
		reply_list(e, i + 1, c, e->boresight[i], 3, "%7.2f");
		break;
	case 'N':
		reply_list(e, i + 1, c, e->tip[i], 3, "%7.3f");
		break;
	case 'r':
		reply_list(e, i + 1, c, e->mounting[i], 3, "%8.3f");
		break;
	case 'I':
		if (n == 2)
			e->increment[i] = v[1];
		else
			reply(e, "2%dI%7.2f", i + 1, e->increment[i]);
		break;
	case 'l':
		if (n == 2)
			switch_station(e, i, v[1] == 1);
		else
			reply(e, "2%dl%d%d%d%d", i + 1, e->on[0], e->on[1], e->on[2],
			      e->on[3]);
		break;
	case 'x':
	case 'v':
		if (n == 4)
			memcpy(e->filters[c == 'v'], v, sizeof(e->filters[0]));
		else if (!n)
			reply(e, "2 %c%6.3f%6.3f%6.3f%6.3f", c, e->filters[c == 'v'][0],
			      e->filters[c == 'v'][1], e->filters[c == 'v'][2],
			      e->filters[c == 'v'][3]);
		else
			error(e, -1);
		break;
	case 'y':
		if (n == 1 && v[0] >= 0 && v[0] <= 2)
			e->sync = (int)v[0];
		else if (!n)
			reply(e, "2 y%d", e->sync);
		else
			error(e, -3);
		break;
	default: /* e */
		if (n == 2 && (v[1] == 0 || v[1] == 1))
			e->mouse = v[1] == 0;
		else
			error(e, -1);
	}
}

static void answer_reals(struct emulator *e, int station, char c, const double *v, int n)
{
	float f[9];

	for (int i = 0; i < n; i++)
		f[i] = (float)v[i];
	reply_frame(e, station, c, 0, f, (size_t)n * 4);
}

static void answer_number(struct emulator *e, char c, uint32_t value)
{
	reply_frame(e, 0, c, 0, &value, 4);
}

static void answer_stations(struct emulator *e)
{
	uint16_t maps[2] = {0, 0};

	for (int j = 0; j < EMULATOR_STATIONS; j++) {
		maps[0] |= (uint16_t)(e->present[j] << j);
		maps[1] |= (uint16_t)(e->on[j] << j);
	}
	reply_frame(e, 0, 'U' & 31, 0, maps, 4);
}

static void liberty_command(struct emulator *e)
{
	char c = e->command[0];
	double v[EMULATOR_ITEMS + 1];
	int n = numbers(e->command + 1, v, EMULATOR_ITEMS + 1), i;
	bool stationed = c && strchr("OHLAN\025", c);

	if (n < 0 || !c ||
	    (stationed && (n < 1 || (!is_station(v[0]) && c != ('U' & 31))))) {
		error(e, -1);
		return;
	}
	if (e->kind == EMULATOR_PATRIOT && stationed && n && v[0] > 2) {
		error(e, -3);
		return;
	}
	i = stationed ? (int)v[0] - 1 : 0;
	if (is_stuck(e, c) && n > stationed)
		return;
	if (c == 'F' && n == 1)
		e->binary = v[0] == 1;
	else if ((c == 'C' || c == 'c') && !n)
		e->continuous = true;
	else if (c == ('V' & 31))
		reply_frame(e, 0, c, 0, "Polhemus Liberty Tracker SN 1234", 32);
	else if (c == 'U' && n == 1)
		e->cm = v[0] == 1;
	else if (c == 'U')
		answer_number(e, c, e->cm);
	else if (c == 'R' && e->kind == EMULATOR_LIBERTY && n == 1)
		e->rate = (int)v[0];
	else if (c == 'R' && e->kind == EMULATOR_LIBERTY)
		answer_number(e, c, (uint32_t)e->rate);
	else if (c == ('U' & 31) && n == 2)
		switch_station(e, i, v[1] == 1);
	else if (c == ('U' & 31))
		answer_stations(e);
	else if (c == 'O' && n > 1)
		set_items(e, i, v + 1, n - 1);
	else if (c == 'L' && n == 2)
		e->mouse = v[1] == 0;
	else if (c == 'H' && n == 4)
		memcpy(e->hemisphere[i], v + 1, sizeof(e->hemisphere[i]));
	else if (c == 'H')
		answer_reals(e, i + 1, c, e->hemisphere[i], 3);
	else if (c == 'A' && n == 1)
		answer_reals(e, i + 1, c, e->alignment[i], 9);
	else if (c == 'N' && n == 1)
		answer_reals(e, i + 1, c, e->tip[i], 3);
	else if ((c == 'X' || c == 'Y') && n == 4)
		memcpy(e->filters[c == 'Y'], v, sizeof(e->filters[0]));
	else if (c == 'X' || c == 'Y')
		answer_reals(e, 0, c, e->filters[c == 'Y'], 4);
	else
		error(e, -99);
}

void emulator_write(struct emulator *e, const void *bytes, size_t n)
{
	const char *at = bytes;

	for (; n && !e->deaf; n--, at++) {
		if (!e->n && at_once(e, *at))
			continue;
		if (*at != '\r') {
			if (e->n + 1 < sizeof(e->command))
				e->command[e->n++] = *at;
			continue;
		}
		e->command[e->n] = '\0';
		e->n = 0;
		if (e->kind == EMULATOR_FASTRAK)
			fastrak_command(e);
		else
			liberty_command(e);
	}
}

static size_t take(unsigned char *from, size_t *waits, void *bytes, size_t size)
{
	size_t n = *waits < size ? *waits : size;

	memcpy(bytes, from, n);
	*waits -= n;
	memmove(from, from + n, *waits);
	return n;
}

size_t emulator_take_replies(struct emulator *e, void *bytes, size_t size)
{
	return take(e->replies, &e->n_replies, bytes, size);
}

size_t emulator_take_records(struct emulator *e, void *bytes, size_t size)
{
	return take(e->records, &e->n_records, bytes, size);
}

size_t emulator_take(struct emulator *e, void *bytes, size_t size)
{
	size_t n = emulator_take_replies(e, bytes, size);

	return n + emulator_take_records(e, (char *)bytes + n, size - n);
}
