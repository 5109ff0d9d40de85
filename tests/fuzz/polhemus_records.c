// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of a tracker under libFuzzer: whatever comes, a sample is one that can be, seq only
 * grows, lost is what is missing in it, and after a pause good records are found again.
 *
 * The first bytes choose the device: family and form, stations, sync; then come pieces, each with
 * its length and how long it took.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/device/polhemus/polhemus_stream.h"

static void wrong(const char *what)
{
	fprintf(stderr, "polhemus_records: %s\n", what);
	abort();
}

static uint64_t next, taken;

static void check_samples(struct polhemus_stream *stream)
{
	struct incise_tracker_sample s;

	while (incise_ring_take(&stream->ring, &s, 1) == 1) {
		const double *q = s.quaternion;
		double norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];

		for (int i = 0; i < 3; i++)
			if (!(fabs(s.position_mm[i]) <= POLHEMUS_ROOM_MM))
				wrong("a position that is none");
		if (!(fabs(norm - 1) < 1e-9))
			wrong("a quaternion that is not unit");
		if (s.status < ' ' || s.status > '~')
			wrong("an error character that is none");
		if (s.station < 1 || s.station > 4 ||
		    !(stream->records.layout.stations >> (s.station - 1) & 1))
			wrong("a station that is off");
		if (taken && s.seq < next)
			wrong("seq goes back");
		next = s.seq + 1;
		taken++;
	}
}

/* One that is good, of the layout's first station. */
static size_t make(const struct polhemus_layout *layout, uint8_t station, uint32_t frame,
		   unsigned char *to)
{
	const float values[7] = {1, 2, 3, 1, 0, 0, 0};
	size_t length = polhemus_layout_length(layout);

	memset(to, 0, length);
	if (layout->family != POLHEMUS_FASTRAK) {
		memcpy(to, layout->family == POLHEMUS_LIBERTY ? "LY" : "PA", 2);
		to[2] = station;
		to[3] = 'C';
		to[6] = 36;
		memcpy(to + 8, values, sizeof(values));
		memcpy(to + 36, &frame, 4);
		return length;
	}
	to[0] = '0';
	to[1] = (unsigned char)('0' + station);
	to[2] = ' ';
	if (layout->ascii)
		memcpy(to + 3, "   1.00   2.00   3.00 1.0000 0.0000 0.0000 0.0000", 49);
	else
		memcpy(to + 3, values, sizeof(values));
	if (layout->ascii)
		memset(to + 52, '0', layout->switch_bytes);
	memcpy(to + length - 2, "\r\n", 2);
	return length;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const struct polhemus_layout layouts[] = {
		{POLHEMUS_FASTRAK, false, 0, 1}, {POLHEMUS_FASTRAK, false, 0, 2},
		{POLHEMUS_FASTRAK, false, 0, 4}, {POLHEMUS_FASTRAK, true, 0, 1},
		{POLHEMUS_FASTRAK, true, 0, 2},	 {POLHEMUS_LIBERTY, false, 0, 0},
		{POLHEMUS_PATRIOT, false, 0, 0},
	};
	struct incise_tracker_setup setup = {.hemisphere = {1, 0, 0}};
	struct polhemus_stream stream;
	struct polhemus_layout layout;
	unsigned char good[POLHEMUS_RECORD_MAX];
	int64_t t_ns = 1000000000;
	uint64_t before;

	if (size < 3)
		return 0;
	layout = layouts[data[0] % 7];
	layout.stations = data[1] & 15 ? data[1] & 15 : 1;
	setup.sync = (enum incise_tracker_sync)(data[2] % 3);
	for (int i = 0; i < 4; i++)
		if (layout.stations >> i & 1)
			setup.stations[setup.n_stations++] = (uint8_t)(i + 1);
	if (polhemus_stream_init(&stream, &setup, &layout))
		return 0;
	next = taken = 0;
	data += 3;
	size -= 3;
	while (size > 2) {
		size_t n = data[0];

		t_ns += (int64_t)data[1] * data[1] * 1000000;
		if (data[1] == 255)
			polhemus_stream_broken(&stream, &layout);
		data += 2;
		size -= 2;
		n = n < size ? n : size;
		polhemus_stream_put(&stream, data, n, t_ns);
		check_samples(&stream);
		data += n;
		size -= n;
	}
	before = taken;
	for (uint32_t i = 0; i < 40; i++) {
		size_t n = make(&layout, setup.stations[i % (uint32_t)setup.n_stations],
				1000 + i / (uint32_t)setup.n_stations, good);

		t_ns += 10000000;
		polhemus_stream_put(&stream, good, n, t_ns);
	}
	check_samples(&stream);
	if (taken < before + 20)
		wrong("good records are not found again");
	if (taken + polhemus_stream_lost(&stream) != next)
		wrong("what is missing in seq is not what is lost");
	polhemus_stream_free(&stream);
	return 0;
}
