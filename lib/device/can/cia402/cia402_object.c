// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * Objects of a drive by name; see cia402_object.h. Every wait has a limit: that of an SDO
 * (struct canopen), or the caller's patience.
 */
#include <errno.h>
#include <string.h>
#include "cia402_object.h"

#define ABORT_NO_OBJECT 0x06020000
#define ABORT_NO_SUB 0x06090011
#define POLL_NS 2000000

const struct cia402_object cia402_statusword = {0x6041, 0, 2, "statusword"};
const struct cia402_object cia402_controlword = {0x6040, 0, 2, "controlword"};
const struct cia402_object cia402_operation = {0x6060, 0, 1, "mode of operation"};
const struct cia402_object cia402_operation_now = {0x6061, 0, 1,
						   "mode of operation display"};

/* Of the last one that failed: the drive does not have the object. */
static bool lacks(const struct canopen *master, int rc)
{
	return rc == -EREMOTEIO &&
	       (master->abort == ABORT_NO_OBJECT || master->abort == ABORT_NO_SUB);
}

int cia402_failed(const struct cia402_talk *talk, const struct cia402_object *object,
		  const char *verb, int rc)
{
	char why[100];

	switch (rc) {
	case -EREMOTEIO:
		return incise_error_set(
			talk->err, EOPNOTSUPP,
			"%s: the drive refuses to let %s (%04X:%u) be %s: %s; see its "
			"manual whether it can do this, and its firmware",
			talk->where, object->name, object->index, object->sub, verb,
			canopen_abort_text(talk->master->abort, why, sizeof(why)));
	case -ETIMEDOUT:
		return incise_error_set(
			talk->err, ETIMEDOUT,
			"%s: no answer when %s (%04X:%u) was to be %s; see the drive's "
			"power, its wiring, node id and bit rate",
			talk->where, object->name, object->index, object->sub, verb);
	case -EPROTO:
		return incise_error_set(
			talk->err, EPROTO,
			"%s: the answer makes no sense when %s (%04X:%u) was to be %s; see "
			"that no other node has this id and that it is a CiA 402 drive",
			talk->where, object->name, object->index, object->sub, verb);
	case -EINTR:
		return incise_error_set(talk->err, EINTR,
					"%s: stopped when %s (%04X:%u) was to be %s",
					talk->where, object->name, object->index,
					object->sub, verb);
	default:
		return incise_error_set(
			talk->err, -rc,
			"%s: the bus %s failed when %s (%04X:%u) was to be %s: %s; see "
			"`ip -details link`, cables and termination",
			talk->where, talk->master->bus->name, object->name, object->index,
			object->sub, verb, strerror(-rc));
	}
}

static int read_object(const struct cia402_talk *talk, const struct cia402_object *object,
		       uint32_t *value)
{
	return canopen_read(talk->master, object->index, object->sub, object->size,
			    value);
}

static int write_object(const struct cia402_talk *talk,
			const struct cia402_object *object, uint32_t value)
{
	return canopen_write(talk->master, object->index, object->sub, object->size,
			     value);
}

static uint32_t cut(const struct cia402_object *object, uint32_t value)
{
	return object->size < 4 ? value & ((1u << 8 * object->size) - 1) : value;
}

int cia402_ask(const struct cia402_talk *talk, const struct cia402_object *object,
	       uint32_t *value)
{
	int rc = read_object(talk, object, value);

	return rc ? cia402_failed(talk, object, "read", rc) : 0;
}

int cia402_tell(const struct cia402_talk *talk, const struct cia402_object *object,
		uint32_t value)
{
	int rc = write_object(talk, object, value);

	return rc ? cia402_failed(talk, object, "written", rc) : 0;
}

static int check(const struct cia402_talk *talk, const struct cia402_object *object,
		 uint32_t value)
{
	uint32_t kept;
	int rc = cia402_ask(talk, object, &kept);

	if (rc || kept == cut(object, value))
		return rc;
	return incise_error_set(
		talk->err, EPROTO,
		"%s: the drive did not keep %s (%04X:%u): %lld was written, %lld is read "
		"(%Xh); see the range that its manual gives",
		talk->where, object->name, object->index, object->sub,
		(long long)cut(object, value), (long long)kept, kept);
}

int cia402_keep(const struct cia402_talk *talk, const struct cia402_object *object,
		uint32_t value)
{
	int rc = cia402_tell(talk, object, value);

	return rc ? rc : check(talk, object, value);
}

int cia402_ask_if(const struct cia402_talk *talk, const struct cia402_object *object,
		  uint32_t *value, bool *has)
{
	int rc = read_object(talk, object, value);

	*has = !rc;
	if (!rc || lacks(talk->master, rc))
		return 0;
	return cia402_failed(talk, object, "read", rc);
}

int cia402_keep_if(const struct cia402_talk *talk, const struct cia402_object *object,
		   uint32_t value, bool *has)
{
	int rc = write_object(talk, object, value);

	*has = !rc;
	if (lacks(talk->master, rc))
		return 0;
	return rc ? cia402_failed(talk, object, "written", rc)
		  : check(talk, object, value);
}

int cia402_see_to(const struct cia402_talk *talk, const struct cia402_object *object,
		  uint32_t value)
{
	uint32_t is;
	int rc = cia402_ask(talk, object, &is);

	if (rc || is == cut(object, value))
		return rc;
	return cia402_keep(talk, object, value);
}

int cia402_pause(const struct cia402_talk *talk, int64_t ns)
{
	struct can_bus *bus = talk->master->bus;
	int rc = canopen_await(talk->master, NULL, bus->ops->now(bus) + ns);

	return rc ? cia402_failed(talk, &cia402_statusword, "read", rc) : 0;
}

int cia402_watch(const struct cia402_talk *talk, bool (*done)(enum cia402_state state),
		 int64_t patience_ns, enum cia402_state *state)
{
	struct can_bus *bus = talk->master->bus;
	int64_t until_ns = bus->ops->now(bus) + patience_ns;
	uint32_t word;
	int rc;

	for (;;) {
		rc = cia402_ask(talk, &cia402_statusword, &word);
		if (rc)
			return rc;
		*state = cia402_state((uint16_t)word);
		if (done(*state))
			return 0;
		if (bus->ops->now(bus) >= until_ns)
			return -ETIME;
		rc = cia402_pause(talk, POLL_NS);
		if (rc)
			return rc;
	}
}
