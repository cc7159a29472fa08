"""Headings of testers, laboratories and people for the columns of tables, in three languages."""

from __future__ import annotations

from tympan.geometry.column import CELSIUS, Meaning

#: What people call time, in English, German and French.
TIMES = Meaning.of("time, zeit, prüfzeit, testzeit, versuchszeit, messzeit, elapsed time, "
                   "laufzeit, temps, durée, temps essai", "s")
#: What people call a displacement, of a plate or of a tester's crosshead.
DISPLACEMENTS = Meaning.of(
    "displacement, deflection, extension, stroke, position, weg, standardweg, traversenweg, "
    "auslenkung, durchbiegung, verschiebung, wegaufnehmer, hub, crosshead, crosshead displacement, "
    "tensile extension, compressive extension, maschinenweg, prüfweg, verlängerung, déplacement, "
    "deplacement traverse, flèche, course, allongement, extension traction", "mm")
#: What people call a force.
FORCES = Meaning.of(
    "force, load, kraft, standardkraft, prüfkraft, zugkraft, last, tensile load, "
    "tensile force, standard force, charge, effort", "N")
#: What people call a load's mass.
MASSES = Meaning.of("mass, weight, masse, gewicht, auflage, zusatzmasse, poids", "g")
#: What people call a mass besides, if its unit is one of masses: in newtons it is a force.
LOADS = Meaning(FORCES.words | Meaning.of(
    "applied load, added load, plate load, dead load, dead weight, test load, payload, load mass, "
    "applied mass, added mass, additional mass, hanging mass, suspended mass, applied weight, "
    "added weight, hanging weight, weight on plate, load on plate, mass on plate, belastung, "
    "auflast, nutzlast, zusatzlast, plattenlast, gewichtslast, lastmasse, zusatzgewicht, "
    "auflagegewicht, hängende masse, angehängte masse, angehängtes gewicht, charge appliquée, "
    "charge suspendue, surcharge, masse ajoutée, masse appliquée, masse suspendue, poids ajouté, "
    "poids suspendu").words, "g")
#: What people call the voltage; as stresses are called so too, the unit tells which it is.
VOLTAGES = Meaning.of("voltage, high voltage, hv, spannung, hochspannung, elektrische spannung, "
                       "prüfspannung, tension, haute tension, tension electrique, u", "kV")
#: What people call a natural frequency.
FREQUENCIES = Meaning.of("frequency, natural frequency, resonance, frequenz, eigenfrequenz, "
                          "resonanzfrequenz, fréquence, fréquence propre", "Hz")
#: What people call a capacitance.
CAPACITANCES = Meaning.of("capacitance, kapazität, capacité", "pF")
#: What people call a run.
RUNS = "run, lauf, messreihe, versuch, zyklus, cycle, essai, série"
#: What people call a specimen or a test piece.
SPECIMENS = ("specimen, sample, probe, prüfkörper, aktor, actuator, éprouvette, échantillon, "
             "actionneur")
#: What people call a temperature.
TEMPERATURES = Meaning.of("temperature, temperatur, prüftemperatur, température", CELSIUS)
#: What people call a stretch, or read in its place.
STRETCHES = (
    Meaning.of("stretch, stretch ratio, lambda, streckung, verstreckung, streckgrad, "
               "taux allongement, extension ratio, rapport allongement"),
    Meaning.of("strain, dehnung, tensile strain, tensile extension, zugdehnung, "
               "standarddehnung, déformation, deformation traction, allongement", offset=1.0),
    Meaning(DISPLACEMENTS.words, "mm", "length", 1.0))
#: What people call a nominal stress, or read in its place; true stresses are none.
STRESSES = (
    Meaning.of("stress, spannung, tensile stress, zugspannung, standardspannung, pk1, contrainte, "
               "contrainte traction, contrainte conventionnelle, tension", "kPa"),
    Meaning(FORCES.words, "N", "area"))
