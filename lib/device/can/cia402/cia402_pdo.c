// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a drive's PDOs hold, set up by SDO in the order that CiA 301 asks for: off, empty,
 * filled, counted, on. A PDO is 1400h/1800h + n (parameters) and 1600h/1A00h + n (mapping).
 *
 *   sub 1  bit 31 off │ bit 30 the drive's own │ 10 … 0 id
 *   sub 2  1: at every SYNC │ 255: at change
 *   sub 3  inhibit time, 100 µs      sub 5  event timer; of an RPDO its deadline; ms
 */
#include <errno.h>
#include "cia402_object.h"

#define RPDO 0x1400
#define TPDO 0x1800
#define MAPPING 0x200 /* from parameters to mapping */
#define PDOS 8	      /* so many are looked for; more are off from power-on on */

#define OFF 0x80000000u
#define KEPT 0x40000000u /* a drive's own bit: no RTR */
#define AT_SYNC 1
#define AT_CHANGE 255
#define INHIBIT \
	100 /* 10 ms, after an input that changed at once; bus_load.c counts on it */

#define MAP_CONTROLWORD 0x60400010
#define MAP_STATUSWORD 0x60410010
#define MAP_POSITION 0x60640020
#define MAP_INPUTS 0x60fd0020
#define MAP_TARGET_POSITION 0x607a0020
#define MAP_TARGET_VELOCITY 0x60ff0020
#define MAP_TARGET_TORQUE 0x60710010

struct pdo {
	uint16_t index;
	uint32_t id;
	uint8_t type;
	uint8_t n; /* objects */
	uint32_t map[2];
};

static struct cia402_object id_of(uint16_t index)
{
	return (struct cia402_object){index, 1, 4, index < TPDO ? "RPDO id" : "TPDO id"};
}

static struct cia402_object mapped(uint16_t index, uint8_t sub)
{
	return (struct cia402_object){(uint16_t)(index + MAPPING), sub, sub ? 4 : 1,
				      sub ? "PDO mapping" : "number of mapped objects"};
}

/* Off, with its own id and bit: only then may the rest be changed. */
static int switch_off(const struct cia402_talk *talk, uint16_t index, uint32_t *id,
		      bool *has)
{
	struct cia402_object object = id_of(index);
	int rc = cia402_ask_if(talk, &object, id, has);

	if (rc || !*has || *id & OFF)
		return rc;
	return cia402_keep(talk, &object, *id | OFF);
}

static int fill(const struct cia402_talk *talk, const struct pdo *pdo)
{
	const struct cia402_object type = {pdo->index, 2, 1, "PDO transmission type"};
	const struct cia402_object count = mapped(pdo->index, 0);
	int rc = cia402_keep(talk, &type, pdo->type);

	if (!rc)
		rc = cia402_tell(talk, &count, 0);
	for (uint8_t i = 0; i < pdo->n && !rc; i++) {
		const struct cia402_object entry = mapped(pdo->index, (uint8_t)(i + 1));

		rc = cia402_keep(talk, &entry, pdo->map[i]);
	}
	return rc ? rc : cia402_keep(talk, &count, pdo->n);
}

static int switch_on(const struct cia402_talk *talk, const struct pdo *pdo, uint32_t id)
{
	struct cia402_object object = id_of(pdo->index);

	return cia402_keep(talk, &object, (id & KEPT) | pdo->id);
}

static int set_pdo(const struct cia402_talk *talk, const struct pdo *pdo)
{
	struct cia402_object object = id_of(pdo->index);
	uint32_t id;
	bool has;
	int rc = switch_off(talk, pdo->index, &id, &has);

	if (rc)
		return rc;
	if (!has)
		return cia402_failed(talk, &object, "read", -EREMOTEIO);
	rc = fill(talk, pdo);
	return rc ? rc : switch_on(talk, pdo, id);
}

/* What others, or the drive's defaults, have it send and take. From @first on. */
static int switch_others_off(const struct cia402_talk *talk, uint16_t base,
			     uint16_t first)
{
	bool has = true;
	uint32_t id;
	int rc = 0;

	for (uint16_t i = first; i < PDOS && has && !rc; i++)
		rc = switch_off(talk, (uint16_t)(base + i), &id, &has);
	return rc;
}

/*
 * Inputs in TPDO2, which is off. A drive whose inputs cannot be mapped has none for us: what
 * is wired to it is not watched, and who needs them says so.
 */
static int set_inputs(const struct cia402_talk *talk, uint32_t id, bool *taken,
		      bool *timed)
{
	static const struct cia402_object inputs = {0x60fd, 0, 4, "digital inputs"};
	static const struct cia402_object inhibit = {TPDO + 1, 3, 2, "PDO inhibit time"};
	static const struct cia402_object timer = {TPDO + 1, 5, 2, "PDO event timer"};
	const struct pdo pdo = {
		TPDO + 1,     CANOPEN_TPDO2 + (uint32_t)talk->master->node, AT_CHANGE, 1,
		{MAP_INPUTS},
	};
	const struct cia402_object count = mapped(pdo.index, 0);
	const struct cia402_object entry = mapped(pdo.index, 1);
	uint32_t now;
	bool has;
	int rc = cia402_ask_if(talk, &inputs, &now, &has);

	*taken = *timed = false;
	if (rc || !has)
		return rc;
	rc = cia402_keep_if(talk, &inhibit, INHIBIT, &has);
	if (!rc)
		rc = cia402_keep_if(talk, &timer, CIA402_INPUTS_MS, timed);
	if (!rc)
		rc = cia402_tell(talk, &count, 0);
	if (rc)
		return rc;
	/*
	 * The one refusal that is an answer: it does not map them, and says so at once or
	 * when they are counted.
	 */
	rc = canopen_write(talk->master, entry.index, entry.sub, 4, MAP_INPUTS);
	if (!rc)
		rc = canopen_write(talk->master, count.index, count.sub, 1, 1);
	if (rc == -EREMOTEIO)
		return 0;
	if (rc)
		return cia402_failed(talk, &entry, "written", rc);
	rc = fill(talk, &pdo);
	if (!rc)
		rc = switch_on(talk, &pdo, id);
	*taken = !rc;
	return rc;
}

static uint32_t target(enum cia402_mode mode)
{
	return mode == CIA402_CST   ? MAP_TARGET_TORQUE
	       : mode == CIA402_CSV ? MAP_TARGET_VELOCITY
				    : MAP_TARGET_POSITION;
}

int cia402_set_pdos(const struct cia402_talk *talk, const struct cia402_setup *setup,
		    struct cia402_taken *taken)
{
	/*
	 * Off: none go out while the bus is borrowed for SDOs. Our heartbeat goes out with
	 * set-points only, so the drive's watch over that is one over them too.
	 */
	static const struct cia402_object deadline = {RPDO, 5, 2, "RPDO deadline"};
	uint32_t node = talk->master->node, id = 0;
	const struct pdo set_points = {
		RPDO,
		CANOPEN_RPDO1 + node,
		AT_SYNC,
		2,
		{MAP_CONTROLWORD, target(setup->mode)},
	};
	const struct pdo actual = {
		TPDO, CANOPEN_TPDO1 + node, AT_SYNC, 2, {MAP_STATUSWORD, MAP_POSITION},
	};
	bool has, kept;
	int rc = switch_others_off(talk, RPDO, 1);

	if (!rc)
		rc = switch_others_off(talk, TPDO, 2);
	if (!rc)
		rc = switch_off(talk, TPDO + 1, &id, &has);
	if (!rc)
		rc = set_pdo(talk, &set_points);
	if (!rc)
		rc = cia402_keep_if(talk, &deadline, 0, &kept);
	if (!rc)
		rc = set_pdo(talk, &actual);
	if (!rc && has)
		rc = set_inputs(talk, id, &taken->inputs, &taken->inputs_timed);
	return rc;
}
