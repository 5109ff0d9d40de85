/* SPDX-License-Identifier: GPL-2.0-or-later */
/* A simulated drive with a CANopen master: the fixture of the CAN tests. */
#ifndef INCISE_TEST_LED_H
#define INCISE_TEST_LED_H

#include "drive.h"

#define LED_MASTER 0x7f
#define LED_DEADMAN_MS 100

struct led {
	struct drive drive;
	struct canopen master;
	struct cia402_setup setup;
	struct cia402_supported supported;
	struct incise_error err;
	struct cia402_client client;
};

static inline void led_init(struct led *led)
{
	*led = (struct led){
		.setup = {.mode = CIA402_CSP,
			  .cycle_ns = 1000000,
			  .deadman_ms = LED_DEADMAN_MS,
			  .master = LED_MASTER,
			  .heartbeat_ms = 20,
			  .position_min = -100,
			  .position_max = 200000,
			  .velocity = 50000,
			  .acceleration = 1000000,
			  .following = 500,
			  .following_ms = 20,
			  .torque_permille = 800},
	};
	drive_init(&led->drive);
	led->master = (struct canopen){.bus = &led->drive.bus,
				       .node = DRIVE_NODE,
				       .own = LED_MASTER,
				       .heartbeat_ns = 20 * DRIVE_MS,
				       .state = CANOPEN_UNKNOWN};
	led->client = (struct cia402_client){&led->master, "here", &led->err};
}

static inline int led_configure(struct led *led)
{
	return cia402_configure(&led->client, &led->setup, &led->supported);
}

/* Write the controlword by SDO, and wait for its effect. */
static inline void led_control(struct led *led, uint16_t word)
{
	canopen_write(&led->master, 0x6040, 0, 2, word);
	canopen_await(&led->master, NULL, led->drive.now_ns + 10 * DRIVE_MS);
}

static inline void led_enable(struct led *led)
{
	led_control(led, CIA402_SHUTDOWN);
	led_control(led, CIA402_SWITCH_ON);
	led_control(led, CIA402_ENABLE);
}

/* Returns the drive's value of an object. */
static inline uint32_t led_value(struct led *led, uint16_t index, uint8_t sub)
{
	return drive_object(&led->drive, index, sub)->value;
}

#endif
