/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Objects of a drive by name: what SDOs say of them becomes a line for people. One thread at
 * a time.
 */
#ifndef INCISE_CIA402_OBJECT_H
#define INCISE_CIA402_OBJECT_H

#include "cia402.h"

struct cia402_object {
	uint16_t index;
	uint8_t sub, size; /* bytes */
	const char *name;
};

/* With whom, and where lines go. */
struct cia402_talk {
	struct canopen *master;
	const char *where; /* lines begin with it */
	struct incise_error *err;
};

/*
 * Read; write; write and read back. 0; -EOPNOTSUPP (aborted), -ETIMEDOUT, -EPROTO (no sense;
 * not kept), of the bus; the line is made.
 */
int cia402_ask(const struct cia402_talk *talk, const struct cia402_object *object,
	       uint32_t *value);
int cia402_tell(const struct cia402_talk *talk, const struct cia402_object *object,
		uint32_t value);
int cia402_keep(const struct cia402_talk *talk, const struct cia402_object *object,
		uint32_t value);

/*
 * The same, where the drive may lack the object: 0 and *has false, no line. Everything else
 * that it says is an error still.
 */
int cia402_ask_if(const struct cia402_talk *talk, const struct cia402_object *object,
		  uint32_t *value, bool *has);
int cia402_keep_if(const struct cia402_talk *talk, const struct cia402_object *object,
		   uint32_t value, bool *has);

/* Keep, but leave alone what is so already: some drives have it read-only. */
int cia402_see_to(const struct cia402_talk *talk, const struct cia402_object *object,
		  uint32_t value);

/* The line of what a read or a write said, or what the bus did. Returns the error. */
int cia402_failed(const struct cia402_talk *talk, const struct cia402_object *object,
		  const char *verb, int rc);

/*
 * Read the statusword again and again until @done says so of its state. 0, -ETIME
 * without a line (*state: the last), or an error with one.
 */
int cia402_watch(const struct cia402_talk *talk, bool (*done)(enum cia402_state state),
		 int64_t patience_ns, enum cia402_state *state);

/* Let so much time go by; frames are taken meanwhile. */
int cia402_pause(const struct cia402_talk *talk, int64_t ns);

extern const struct cia402_object cia402_statusword, cia402_controlword, cia402_operation,
	cia402_operation_now;

/* Limits that the drive holds; those that it lacks are false in @taken. */
int cia402_set_limits(const struct cia402_talk *talk, const struct cia402_setup *setup,
		      struct cia402_taken *taken);

/* RPDO1, TPDO1, TPDO2; the others are switched off. See cia402_configure(). */
int cia402_set_pdos(const struct cia402_talk *talk, const struct cia402_setup *setup,
		    struct cia402_taken *taken);

#endif
