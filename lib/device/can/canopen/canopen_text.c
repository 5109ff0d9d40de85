// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * CANopen's numbers in words: SDO abort codes (CiA 301, table 22), error codes of EMCYs
 * (CiA 301, table 26; those of drives: CiA 402-2 by IEC 61800-7-201), NMT states.
 */
#include <stdio.h>
#include "canopen.h"

struct word {
	uint32_t code;
	const char *text;
};

/* By rising code. */
static const struct word aborts[] = {
	{0x05030000, "toggle bit not alternated"},
	{0x05040000, "SDO protocol timed out"},
	{0x05040001, "command specifier not valid or unknown"},
	{0x05040002, "invalid block size"},
	{0x05040003, "invalid sequence number"},
	{0x05040004, "CRC error"},
	{0x05040005, "out of memory"},
	{0x06010000, "unsupported access to an object"},
	{0x06010001, "attempt to read a write-only object"},
	{0x06010002, "attempt to write a read-only object"},
	{0x06020000, "object does not exist"},
	{0x06040041, "object cannot be mapped to the PDO"},
	{0x06040042, "mapped objects would be longer than a PDO"},
	{0x06040043, "general parameter incompatibility"},
	{0x06040047, "general internal incompatibility in the device"},
	{0x06060000, "access failed due to a hardware error"},
	{0x06070010, "data type or length does not match"},
	{0x06070012, "data type does not match: too long"},
	{0x06070013, "data type does not match: too short"},
	{0x06090011, "sub-index does not exist"},
	{0x06090030, "invalid value"},
	{0x06090031, "value too high"},
	{0x06090032, "value too low"},
	{0x06090036, "maximum is less than minimum"},
	{0x060a0023, "resource not available: SDO connection"},
	{0x08000000, "general error"},
	{0x08000020, "data cannot be transferred or stored"},
	{0x08000021, "data cannot be transferred or stored: local control"},
	{0x08000022, "data cannot be transferred or stored in this state of the device"},
	{0x08000023, "no object dictionary is present"},
	{0x08000024, "no data available"},
};

/* By falling code; xx00 and x000 are classes. */
static const struct word emcys[] = {
	{0xff00, "fault of the manufacturer's own"},
	{0xf000, "additional functions"},
	{0x9000, "external error"},
	{0x8a00, "not stopped at the limit"},
	{0x8900, "speed of the motors is not the same"},
	{0x8612, "reference limit"},
	{0x8611, "following error too large"},
	{0x8600, "positioning controller"},
	{0x8500, "torque controller, overshoot"},
	{0x8480, "speed too high or too low"},
	{0x8400, "velocity controller"},
	{0x8331, "torque fault"},
	{0x8313, "standstill torque"},
	{0x8312, "difficult start-up"},
	{0x8311, "excess torque"},
	{0x8300, "torque control"},
	{0x8250, "RPDO time-out: set-points stopped"},
	{0x8240, "unexpected length of SYNC"},
	{0x8230, "destination of a multiplexed PDO not available"},
	{0x8220, "PDO length exceeded"},
	{0x8210, "PDO not processed: wrong length"},
	{0x8200, "protocol error"},
	{0x8150, "CAN-ID collision"},
	{0x8140, "recovered from bus-off"},
	{0x8130, "life guard or heartbeat error"},
	{0x8120, "CAN in error passive mode"},
	{0x8110, "CAN overrun: frames lost"},
	{0x8100, "communication"},
	{0x8000, "monitoring"},
	{0x7600, "data storage"},
	{0x7510, "serial interface"},
	{0x7500, "communication inside the drive"},
	{0x7400, "computation circuit"},
	{0x7320, "position sensor"},
	{0x7310, "speed sensor"},
	{0x7306, "incremental sensor 2"},
	{0x7305, "incremental sensor 1"},
	{0x7304, "resolver 2"},
	{0x7303, "resolver 1"},
	{0x7302, "tacho with wrong polarity"},
	{0x7301, "tacho"},
	{0x7300, "sensor"},
	{0x7200, "measurement circuit"},
	{0x7122, "motor or commutation malfunction"},
	{0x7121, "motor blocked"},
	{0x7120, "motor"},
	{0x7110, "brake chopper"},
	{0x7100, "power additional modules"},
	{0x7000, "additional modules"},
	{0x6330, "error in the parameters"},
	{0x6320, "parameter error"},
	{0x6310, "loss of parameters"},
	{0x6300, "data record"},
	{0x6200, "user software"},
	{0x6100, "internal software"},
	{0x6010, "software reset (watchdog)"},
	{0x6000, "software of the device"},
	{0x5540, "EEPROM"},
	{0x5530, "non-volatile data memory"},
	{0x5520, "ROM or EPROM"},
	{0x5510, "RAM"},
	{0x5500, "data storage"},
	{0x5442, "contacts 2"},
	{0x5441, "contacts 1"},
	{0x5440, "contacts"},
	{0x5430, "input stages"},
	{0x5420, "chopper"},
	{0x5410, "output stages"},
	{0x5400, "power section"},
	{0x5300, "operating unit"},
	{0x5220, "computing circuit"},
	{0x5210, "measurement circuit"},
	{0x5200, "control hardware"},
	{0x5114, "supply low voltage: 5 V of the electronics"},
	{0x5113, "supply low voltage: 5 V"},
	{0x5112, "supply low voltage: 24 V"},
	{0x5111, "supply low voltage: ±15 V"},
	{0x5110, "low supply voltage"},
	{0x5100, "supply"},
	{0x5000, "hardware of the device"},
	{0x4430, "excess temperature: power stage"},
	{0x4420, "temperature of the supply too low"},
	{0x4410, "temperature of the supply too high"},
	{0x4400, "temperature of the supply"},
	{0x4320, "temperature of the drive too low"},
	{0x4310, "temperature of the drive too high"},
	{0x4300, "temperature of the drive"},
	{0x4220, "temperature of the device too low"},
	{0x4210, "temperature of the device too high"},
	{0x4200, "temperature of the device"},
	{0x4120, "ambient temperature too low"},
	{0x4110, "ambient temperature too high"},
	{0x4100, "ambient temperature"},
	{0x4000, "temperature"},
	{0x3331, "field circuit interrupted"},
	{0x3330, "field circuit"},
	{0x3320, "armature circuit"},
	{0x3310, "output voltage too high"},
	{0x3300, "output voltage"},
	{0x3230, "load error"},
	{0x3222, "DC link under-voltage 2"},
	{0x3221, "DC link under-voltage 1"},
	{0x3220, "DC link under-voltage"},
	{0x3212, "DC link over-voltage 2"},
	{0x3211, "DC link over-voltage 1"},
	{0x3210, "DC link over-voltage"},
	{0x3200, "voltage inside the device"},
	{0x3130, "phase failure"},
	{0x3120, "mains under-voltage"},
	{0x3110, "mains over-voltage"},
	{0x3100, "mains voltage"},
	{0x3000, "voltage"},
	{0x2396, "current of the holding brake"},
	{0x2350, "motor overloaded (I²t)"},
	{0x2340, "short circuit, motor side"},
	{0x2330, "earth leakage, motor side"},
	{0x2320, "short circuit or earth leakage, motor side"},
	{0x2310, "continuous over-current, motor side"},
	{0x2300, "current, motor side"},
	{0x2220, "continuous over-current inside the device"},
	{0x2213, "over-current in the ramp"},
	{0x2212, "over-current 2 inside the device"},
	{0x2211, "over-current 1 inside the device"},
	{0x2200, "current inside the device"},
	{0x2130, "short circuit"},
	{0x2120, "short to earth"},
	{0x2110, "short circuit or earth leakage, input side"},
	{0x2100, "current, input side"},
	{0x2000, "current"},
	{0x1000, "generic error"},
	{0x0000, "no error, or reset"},
};

#define COUNT(table) (sizeof(table) / sizeof((table)[0]))

const char *canopen_abort_text(uint32_t code, char *text, size_t size)
{
	const char *what = "an abort code that CiA 301 does not have";

	for (size_t i = 0; i < COUNT(aborts); i++)
		if (aborts[i].code == code)
			what = aborts[i].text;
	snprintf(text, size, "%s (%08Xh)", what, code);
	return text;
}

/* The code itself, else the class that it is of: xx00, then x000. */
static const char *emcy_word(uint16_t code)
{
	static const uint16_t masks[] = {0xffff, 0xfff0, 0xff00, 0xf000};

	for (size_t m = 0; m < COUNT(masks); m++)
		for (size_t i = 0; i < COUNT(emcys); i++)
			if (emcys[i].code == (code & masks[m]) &&
			    (emcys[i].code || !code))
				return emcys[i].text;
	return NULL;
}

const char *canopen_emcy_text(uint16_t code, char *text, size_t size)
{
	const char *what = emcy_word(code);

	snprintf(text, size, "%s (%04Xh)", what ? what : "an error without a class",
		 code);
	return text;
}

const char *canopen_state_name(enum canopen_state state)
{
	switch (state) {
	case CANOPEN_BOOT_UP:
		return "booting";
	case CANOPEN_STOPPED:
		return "stopped";
	case CANOPEN_OPERATIONAL:
		return "operational";
	case CANOPEN_PRE_OPERATIONAL:
		return "pre-operational";
	case CANOPEN_UNKNOWN:
		break;
	}
	return "not heard";
}
