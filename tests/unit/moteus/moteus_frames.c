// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Tests of frames of lib/device/moteus/moteus.h: bytes are those of mjbots' own library, values
 * those that it reads; what is cut off, refused or mutated is found.
 */
#include "../unit.h"
#include "../cases.h"
#include "../../../lib/device/moteus/moteus.h"
#include "library.h"

#define ID 3

static size_t from_hex(uint8_t *bytes, const char *hex)
{
	size_t n = strlen(hex) / 2;

	for (size_t i = 0; i < n; i++)
		assert_int_equal(sscanf(hex + 2 * i, "%2hhx", &bytes[i]), 1);
	return n;
}

static void assert_bytes(const struct canfd_frame *frame, const char *hex)
{
	uint8_t bytes[CANFD_MAX_DLEN];

	assert_int_equal(frame->can_id, 0x8003 | CAN_EFF_FLAG);
	assert_int_equal(frame->flags, CANFD_BRS);
	assert_int_equal(frame->len, from_hex(bytes, hex));
	assert_memory_equal(frame->data, bytes, frame->len);
}

static struct canfd_frame answer_of(const char *hex)
{
	struct canfd_frame frame = {.can_id = ID << 8};

	frame.len = (uint8_t)from_hex(frame.data, hex);
	return frame;
}

TEST(frames_are_those_of_the_library)
{
	struct canfd_frame frame;

	moteus_pack_query(&frame, ID);
	assert_bytes(&frame, library_query);
	moteus_pack_stop(&frame, ID);
	assert_bytes(&frame, library_stop);
	for (size_t i = 0; i < sizeof(library_torques) / sizeof(*library_torques); i++) {
		moteus_pack_torque(&frame, ID, library_torques[i].torque,
				   library_torques[i].most, library_torques[i].watchdog);
		assert_bytes(&frame, library_torques[i].bytes);
	}
}

TEST(values_are_those_that_the_library_reads)
{
	for (size_t i = 0; i < sizeof(library_answers) / sizeof(*library_answers); i++) {
		struct canfd_frame frame = answer_of(library_answers[i].bytes);
		struct moteus_reply reply;

		assert_int_equal(moteus_parse(&frame, &reply), ID);
		assert_true(reply.mode == library_answers[i].mode);
		assert_true(reply.position_turns == library_answers[i].position);
		assert_true(reply.velocity_turns_s == library_answers[i].velocity);
		assert_true(reply.torque_N_m == library_answers[i].torque);
		assert_true(reply.voltage_V == library_answers[i].voltage);
		assert_true(reply.temperature_C == library_answers[i].temperature);
		assert_true(reply.fault == library_answers[i].fault);
		assert_int_equal(reply.refused, -1);
	}
}

/* The id of what is parsed, of bytes that are no good answer. */
static int parse(const char *hex, struct moteus_reply *reply)
{
	struct canfd_frame frame = answer_of(hex);

	return moteus_parse(&frame, reply);
}

TEST(other_answers)
{
	static const char *const bad[] = {
		"",
		"5050",
		/* no fault at the end; cut off in a float; in a head */
		"21000a2f01000000000000000000000000230d301f",
		"21000a2f0100000000000000000000",
		"21000a2f",
		"21",
		/* a command; int16; another register; a stream; half a refusal */
		"01000a2f01000000000000000000000000230d301f00",
		"25000a2f01000000000000000000000000230d301f00",
		"21000a2f01000000000000000000000000230c301f00",
		"400100",
		"30",
	};
	struct moteus_reply reply;

	for (size_t i = 0; i < sizeof(bad) / sizeof(*bad); i++)
		assert_int_equal(parse(bad[i], &reply), 0);
	assert_int_equal(parse("21000a2f010000c07f0000c07f0000c07f230d301f0050", &reply),
			 ID);
	assert_true(isnan(reply.position_turns) && isnan(reply.velocity_turns_s));
	/* refused: a write, and each read */
	assert_int_equal(parse("302701", &reply), ID);
	assert_int_equal(reply.refused, 0x27);
	assert_int_equal(parse("310001", &reply), ID);
	assert_int_equal(reply.refused, 0);
	assert_int_equal(parse("21000a310201", &reply), ID);
	assert_int_equal(reply.refused, 2);
	assert_int_equal(parse("21000a2f01000000000000000000000000310d01", &reply), ID);
	assert_int_equal(reply.refused, 0x0d);
}

TEST(ids)
{
	static const struct {
		canid_t id;
		int sender;
	} cases[] = {
		{0x100, 1},
		{0x100 | CAN_EFF_FLAG, 1},
		{0x7f00 | CAN_EFF_FLAG, 127},
		{0x8000 | CAN_EFF_FLAG, 0},
		{0x10300 | CAN_EFF_FLAG, 0},
		{0x301, 0},
		{0x300 | CAN_ERR_FLAG, 0},
		{0x300 | CAN_RTR_FLAG, 0},
		{0, 0},
	};
	struct moteus_reply reply;

	for (size_t i = 0; i < sizeof(cases) / sizeof(*cases); i++) {
		struct canfd_frame frame = answer_of(library_answers[0].bytes);

		frame.can_id = cases[i].id;
		assert_int_equal(moteus_parse(&frame, &reply), cases[i].sender);
	}
}

TEST(faults_have_texts)
{
	for (int i = -130; i < 130; i++)
		assert_non_null(moteus_fault_text(i));
	assert_string_equal(moteus_fault_text(38), "over temperature");
}

TEST(mutated_answers)
{
	int n = cases_of(100000, 0);
	unsigned int seed = 1;

	for (int i = 0; i < n; i++) {
		struct canfd_frame frame = answer_of(library_answers[i % 4].bytes);
		struct moteus_reply reply;
		int changes = 1 + rand_r(&seed) % 8;

		frame.len = (uint8_t)(rand_r(&seed) % 3 ? frame.len : rand_r(&seed) % 65);
		for (int k = 0; k < changes; k++)
			frame.data[rand_r(&seed) % CANFD_MAX_DLEN] =
				(uint8_t)rand_r(&seed);
		if (moteus_parse(&frame, &reply))
			assert_true(reply.refused >= -1 && reply.refused < 256 &&
				    reply.mode >= -128 && reply.mode < 128);
	}
}
