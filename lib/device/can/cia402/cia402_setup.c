// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Everything that a drive is told before it may move, in an order in which a drive that was
 * stopped half-way has no power and no PDOs that somebody could move it with.
 *
 *   no power? ─▶ pre-operational ─▶ PDOs off, filled, on ─▶ what it does alone ─▶ limits,
 *   mode, cycle ─▶ heartbeats ─▶ operational
 */
#include <errno.h>
#include "cia402_object.h"

#define MS_NS 1000000LL
#define NMT_NS (500 * MS_NS) /* for an NMT state to be taken */
#define SYNC_ID 0x80
#define QUICK_STOP 3	/* 6007 */
#define RAMP_THEN_OFF 2 /* 605A: on the quick-stop ramp, then without power */

static const struct cia402_object sync_id = {0x1005, 0, 4, "SYNC id"};
static const struct cia402_object sync_period = {0x1006, 0, 4, "communication cycle"};
static const struct cia402_object sync_window = {0x1007, 0, 4, "SYNC window"};
static const struct cia402_object emcy_id = {0x1014, 0, 4, "EMCY id"};
static const struct cia402_object consumer = {0x1016, 1, 4, "heartbeat consumer"};
static const struct cia402_object producer = {0x1017, 0, 2, "heartbeat producer"};
static const struct cia402_object behaviour = {0x1029, 1, 1,
					       "behaviour without a master"};
static const struct cia402_object abort_option = {0x6007, 0, 2,
						  "abort connection option"};
static const struct cia402_object stop_option = {0x605a, 0, 2, "quick-stop option"};
static const struct cia402_object cycle = {0x60c2, 1, 1, "interpolation period"};
static const struct cia402_object cycle_power = {0x60c2, 2, 1,
						 "interpolation period's power of ten"};
/* No object; for the line of a command that was not sent. */
static const struct cia402_object nmt = {0, 0, 0, "NMT state"};
static const struct cia402_object modes = {0x6502, 0, 4, "supported drive modes"};

/* What can be written, before anything is. */
static int check_setup(const struct cia402_talk *talk, const struct cia402_setup *setup)
{
	const char *what = NULL;

	if (!setup->deadman_ms || setup->deadman_ms > UINT16_MAX)
		what = "a deadman of less than 1 ms or more than 65 s";
	else if (!setup->heartbeat_ms || setup->heartbeat_ms > UINT16_MAX)
		what = "a heartbeat of less than 1 ms or more than 65 s";
	else if (!setup->master || setup->master > 127 ||
		 setup->master == talk->master->node)
		what = "a node id of this program that is 0, over 127 or the drive's own";
	else if (talk->master->own != setup->master || talk->master->heartbeat_ns <= 0 ||
		 talk->master->heartbeat_ns >= setup->deadman_ms * MS_NS)
		what = "a deadman that this program's heartbeats do not keep off";
	else if (setup->mode != CIA402_CSP && setup->mode != CIA402_CSV &&
		 setup->mode != CIA402_CST)
		what = "a mode that is not cyclic";
	else if (!setup->cycle_ns)
		what = "a cycle of 0";
	return what ? incise_error_set(talk->err, EINVAL,
				       "%s: %s cannot be set up; see rig.conf",
				       talk->where, what)
		    : 0;
}

static int check_power(const struct cia402_talk *talk)
{
	uint32_t word;
	int rc = cia402_ask(talk, &cia402_statusword, &word);
	enum cia402_state state = rc ? CIA402_UNKNOWN : cia402_state((uint16_t)word);

	if (rc || !cia402_powered(state))
		return rc;
	return incise_error_set(
		talk->err, EBUSY,
		"%s: the drive has power (%s); somebody else leads it, or "
		"it was left so: disable it first",
		talk->where, cia402_state_name(state));
}

static int tell_nmt(const struct cia402_talk *talk, enum canopen_command command)
{
	int rc = canopen_send_nmt(talk->master, command);

	/* The queue of the bus is full: it empties, or the bus is stuck. */
	for (int i = 0; i < 10 && rc == -ENOBUFS; i++) {
		rc = cia402_pause(talk, MS_NS);
		if (rc)
			return rc;
		rc = canopen_send_nmt(talk->master, command);
	}
	return rc ? cia402_failed(talk, &nmt, "changed", rc) : 0;
}

/* For a drive that can make use of it: one that refuses it does without. */
static int hint(const struct cia402_talk *talk, const struct cia402_object *object,
		uint32_t value)
{
	int rc = canopen_write(talk->master, object->index, object->sub, object->size,
			       value);

	return rc && rc != -EREMOTEIO ? cia402_failed(talk, object, "written", rc) : 0;
}

/*
 * The mode, its cycle, and the SYNC. What 1006 and 1007 say is a hint to drives that lock
 * their loops to SYNC.
 */
static int set_cycle(const struct cia402_talk *talk, const struct cia402_setup *setup)
{
	/* Drives that hold only one power of ten hold ms. */
	static const int8_t powers[] = {-3, -4, -5, -6, -2, -1, 0};
	uint32_t supported = 0;
	bool has;
	int rc = cia402_ask_if(talk, &modes, &supported, &has);

	if (rc)
		return rc;
	if (has && !(supported & 1u << (setup->mode - 1)))
		return incise_error_set(
			talk->err, EOPNOTSUPP,
			"%s: the drive does not have the mode %s: its "
			"6502:0 is %08Xh; choose another mode in rig.conf, "
			"or see its firmware",
			talk->where, cia402_mode_name(setup->mode), supported);
	rc = cia402_set_mode(talk->master, setup->mode, talk->where, talk->err);
	if (!rc)
		rc = cia402_see_to(talk, &sync_id, SYNC_ID);
	if (rc)
		return rc;
	rc = hint(talk, &sync_period, setup->cycle_ns / 1000);
	if (!rc)
		rc = hint(talk, &sync_window, 0);
	if (rc)
		return rc;
	for (size_t i = 0; i < sizeof(powers); i++) {
		uint64_t unit_ns = 1000000000;

		for (int k = 0; k > powers[i]; k--)
			unit_ns /= 10;
		if (setup->cycle_ns % unit_ns || setup->cycle_ns / unit_ns > UINT8_MAX)
			continue;
		rc = cia402_see_to(talk, &cycle, (uint32_t)(setup->cycle_ns / unit_ns));
		return rc ? rc : cia402_see_to(talk, &cycle_power, (uint32_t)powers[i]);
	}
	return incise_error_set(talk->err, EINVAL,
				"%s: a cycle of %u ns is no digit times a power of ten; "
				"choose another cycle_us in rig.conf",
				talk->where, setup->cycle_ns);
}

/* What it does when this side is silent, and that it notices. */
static int set_watch(const struct cia402_talk *talk, const struct cia402_setup *setup)
{
	struct canopen *master = talk->master;
	uint32_t id = 0;
	bool has;
	int rc = cia402_keep(talk, &abort_option, QUICK_STOP);

	if (!rc)
		rc = cia402_keep(talk, &stop_option, RAMP_THEN_OFF);
	/* Pre-operational without us: then PDOs that come late do nothing. */
	if (!rc)
		rc = cia402_keep_if(talk, &behaviour, 0, &has);
	if (!rc)
		rc = cia402_ask(talk, &emcy_id, &id);
	if (!rc && id != (uint32_t)CANOPEN_EMCY + master->node)
		rc = cia402_keep(talk, &emcy_id, (uint32_t)CANOPEN_EMCY + master->node);
	if (!rc)
		rc = cia402_keep(talk, &producer, setup->heartbeat_ms);
	if (!rc)
		rc = cia402_keep(talk, &consumer,
				 (uint32_t)setup->master << 16 | setup->deadman_ms);
	return rc;
}

static bool is_operational(const struct canopen *master)
{
	return master->state == CANOPEN_OPERATIONAL;
}

/* It tells by its heartbeat, which it has by now. */
static int start(const struct cia402_talk *talk, const struct cia402_setup *setup)
{
	struct canopen *master = talk->master;
	struct can_bus *bus = master->bus;
	int rc;

	/* The drive watches over heartbeats from the first one on. */
	master->next_heartbeat_ns = 0;
	master->state = CANOPEN_UNKNOWN;
	rc = tell_nmt(talk, CANOPEN_START);
	if (rc)
		return rc;
	rc = canopen_await(master, is_operational,
			   bus->ops->now(bus) + NMT_NS + 2 * MS_NS * setup->heartbeat_ms);
	if (rc == -ETIMEDOUT)
		return incise_error_set(
			talk->err, ETIMEDOUT,
			"%s: the drive does not become operational: its heartbeat says "
			"%s; see its EMCY codes with `incise info` of this bus",
			talk->where, canopen_state_name(master->state));
	if (rc)
		return cia402_failed(talk, &nmt, "heard", rc);
	return check_power(talk);
}

int cia402_configure(struct canopen *master, const struct cia402_setup *setup,
		     struct cia402_taken *taken, const char *where,
		     struct incise_error *err)
{
	const struct cia402_talk talk = {master, where, err};
	struct cia402_taken took = {0};
	int rc;

	*taken = took;
	rc = check_setup(&talk, setup);
	if (!rc)
		rc = check_power(&talk);
	if (!rc)
		rc = tell_nmt(&talk, CANOPEN_PREPARE);
	if (!rc)
		rc = cia402_set_pdos(&talk, setup, &took);
	if (!rc)
		rc = cia402_set_limits(&talk, setup, &took);
	if (!rc)
		rc = set_cycle(&talk, setup);
	if (!rc)
		rc = set_watch(&talk, setup);
	if (!rc)
		rc = start(&talk, setup);
	if (!rc)
		*taken = took;
	return rc;
}
