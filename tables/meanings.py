"""Headings that testers and laboratories give columns of tables, in thirteen languages.

English, German, French, Italian, Spanish, Portuguese, Dutch, Polish, Czech, Turkish and Swedish,
Chinese and Japanese, the last one in Latin letters too. The words of one column stand together,
those of a language in a line.
"""

from __future__ import annotations

from tympan.tables.column import CELSIUS, Meaning, plain_words

#: Words of sensors and supplies, by the dimension of what they give: where theirs is the only
#: column of that dimension, it is the quantity.
SENSORS = {
    "length": Meaning.of(
        "laser, lvdt, keyence, lk g, lk h, lk, optoncdt, micro epsilon, baumer, vibrometer, "
        "triangulation, displacement sensor, dial gauge, camera, stage, "
        "wegsensor, messuhr, messtaster, lasersensor, abstandssensor, "
        "capteur laser, capteur de déplacement, comparateur, "
        "sensore laser, comparatore, sensor láser, láser, comparador"),
    "voltage": Meaning.of(
        "trek, heinzinger, fug, matsusada, amplifier, hv amp, power supply, supply, psu, "
        "netzteil, hochspannungsnetzteil, verstärker, netzgerät, "
        "alimentation, amplificateur, alimentatore, amplificatore, fuente, amplificador"),
    "force": Meaning.of(
        "load cell, loadcell, force sensor, force gauge, dynamometer, "
        "wägezelle, kraftaufnehmer, kraftsensor, kraftmessdose, kraftmesser, "
        "capteur de force, cellule de charge, dynamomètre, "
        "cella di carico, dinamometro, celda de carga, dinamómetro"),
    "mass": Meaning.of("waage, scale, balance, bilancia, balanza, weights, gewichte")}
#: Headings of time.
TIMES = Meaning.of(
    "time, elapsed time, t, "
    "zeit, prüfzeit, testzeit, versuchszeit, messzeit, laufzeit, "
    "temps, durée, temps essai, "
    "tempo, tempo trascorso, tiempo, tiempo transcurrido, tempo decorrido, "
    "tijd, verstreken tijd, czas, čas, doba, zaman, süre, geçen süre, tid, "
    "时间, 時間, 経過時間, jikan", "s")
#: Headings of a displacement, of a plate or of a tester's crosshead.
DISPLACEMENTS = Meaning.of(
    "displacement, deflection, extension, stroke, position, crosshead, crosshead displacement, "
    "tensile extension, compressive extension, sag, travel, "
    "weg, standardweg, traversenweg, auslenkung, durchbiegung, verschiebung, wegaufnehmer, hub, "
    "traverse, maschinenweg, prüfweg, verlängerung, absenkung, durchhang, "
    "déplacement, deplacement traverse, flèche, course, allongement, extension traction, "
    "affaissement, abaissement, enfoncement, "
    "spostamento, abbassamento, corsa, inflessione, cedimento, freccia, deflessione, posizione, "
    "desplazamiento, deflexión, flecha, descenso, hundimiento, carrera, posición, alargamiento, "
    "deslocamento, deflexão, curso, afundamento, posição, alongamento, "
    "verplaatsing, uitwijking, doorbuiging, slag, doorzakking, positie, verlenging, "
    "przemieszczenie, ugięcie, wychylenie, skok, pozycja, wydłużenie, droga, "
    "posunutí, posuv, průhyb, výchylka, zdvih, poloha, prodloužení, dráha, "
    "yer değiştirme, çökme, sehim, deplasman, sapma, konum, uzama, strok, "
    "förskjutning, nedböjning, utböjning, förflyttning, slaglängd, läge, förlängning, väg, "
    "位移, 挠度, 撓度, 行程, 位置, 伸长, 下沉量, "
    "変位, 変位量, たわみ, ストローク, 伸び, hen'i, heni, tawami", "mm")
#: Headings of a load: a force in newtons, or the mass on the film in grams.
_FORCE_OR_MASS = ("load, last, charge, carico, carga, belasting, obciążenie, zatížení, yük, "
                  "载荷, 載荷, 负荷, 荷重, kaju")
#: Headings of a force.
FORCES = Meaning.of(
    f"force, {_FORCE_OR_MASS}, tensile load, tensile force, standard force, "
    "kraft, standardkraft, prüfkraft, zugkraft, effort, forza, fuerza, força, kracht, "
    "siła, síla, kuvvet, 力, 試験力, chikara", "N")
#: Headings of the total mass on the film, with the plate.
TOTALS = Meaning.of(
    "total mass, mass total, total load, total weight, gesamtmasse, gesamtgewicht, gesamtlast, "
    "masse gesamt, masse totale, poids total, charge totale, massa totale, peso totale, "
    "carico totale, masa total, peso total, carga total, massa total, totale massa, "
    "totaal gewicht, masa całkowita, ciężar całkowity, celková hmotnost, toplam kütle, "
    "toplam ağırlık, totalmassa, totalvikt, 总质量, 總質量, 全質量, 総質量", "g")
#: Headings of a mass.
MASSES = Meaning.of(
    "mass, weight, m, masse, gewicht, poids, massa, peso, masa, ciężar, hmotnost, kütle, ağırlık, "
    "vikt, 质量, 質量, 重量, 重さ, shitsuryo", "g")
#: Further headings of a mass, if its unit is one of masses: in newtons it is a force.
LOADS = Meaning.of(
    f"{_FORCE_OR_MASS}, applied load, added load, plate load, dead load, dead weight, test load, "
    "payload, load mass, applied mass, added mass, additional mass, hanging mass, "
    "suspended mass, applied weight, added weight, hanging weight, weight on plate, "
    "load on plate, mass on plate, "
    "auflage, zusatzmasse, belastung, auflast, nutzlast, zusatzlast, plattenlast, gewichtslast, "
    "lastmasse, zusatzgewicht, auflagegewicht, hängende masse, angehängte masse, "
    "angehängtes gewicht, "
    "charge appliquée, charge suspendue, surcharge, masse ajoutée, masse appliquée, "
    "masse suspendue, poids ajouté, poids suspendu, "
    "zavorra, peso applicato, peso aggiunto, massa aggiunta, massa appesa, carico applicato, "
    "masa añadida, masa colgada, peso añadido, carga aplicada, "
    "massa adicionada, massa suspensa, peso adicionado, toegevoegde massa, extra massa, "
    "obciążnik, dodatkowa masa, zátěž, závaží, přidaná hmotnost, ek kütle, ilave kütle, "
    "tillagd massa, hängande massa, 砝码, 砝碼, 负载, 附加质量, おもり, 錘, omori", "g")
#: Headings of the voltage set at a supply, in tables that also have the measured one.
SET_VOLTAGES = Meaning.of(
    "vset, u set, uset, v prog, vprog, hv set, set hv, hv soll, usoll, soll, set, "
    "set voltage, voltage set, voltage setpoint, setpoint, set point, target voltage, v set, "
    "command voltage, commanded voltage, programmed voltage, "
    "sollspannung, spannung soll, u soll, eingestellte spannung, tension consigne, consigne, "
    "tensione impostata, voltaje fijado, voltaje ajustado, tensão ajustada, "
    "ingestelde spanning, napięcie zadane, nastavené napětí, ayarlanan gerilim, "
    "inställd spänning, 设定电压, 設定電壓, 設定電圧", "kV")
#: Headings of the voltage; stresses have the same words, and the unit decides.
VOLTAGES = Meaning.of(
    "voltage, high voltage, hv, applied voltage, drive voltage, driving voltage, u, v, "
    "spannung, hochspannung, elektrische spannung, prüfspannung, angelegte spannung, "
    "tension, haute tension, tension electrique, tension appliquée, "
    "tensione, alta tensione, voltaje, alto voltaje, alta tensión, tensión, voltaje aplicado, "
    "tensão, alta tensão, tensão elétrica, voltagem, spanning, hoogspanning, "
    "napięcie, wysokie napięcie, napětí, vysoké napětí, gerilim, voltaj, yüksek gerilim, "
    "spänning, högspänning, 电压, 電壓, 高压, 施加电压, 電圧, 高電圧, 印加電圧, denatsu", "kV")
#: Headings of the voltage measured on the film by a probe.
FILM_VOLTAGES = Meaning.of(
    "film voltage, voltage on film, voltage at film, probe voltage, membrane voltage, "
    "filmspannung, spannung am film, membranspannung, folienspannung, tension du film, "
    "tension membrane, tensione del film, voltaje de la película, 膜电压, 膜電圧", "kV")
#: Headings of the lower one of two voltages, and the higher one.
LOWER_VOLTAGES = Meaning.of(
    "min voltage, voltage min, minimum voltage, lower voltage, low voltage, u min, umin, v min, "
    "vmin, start voltage, u1, v1, untere spannung, spannung min, minimalspannung, "
    "tension min, tension minimale, tensione minima, tensione min, voltaje mínimo, tensão mínima, "
    "minimale spanning, napięcie minimalne, minimální napětí, minimum gerilim, minsta spänning, "
    "最小电压, 最小電圧", "kV")
HIGHER_VOLTAGES = Meaning.of(
    "max voltage, voltage max, maximum voltage, upper voltage, peak voltage, u max, umax, v max, "
    "vmax, end voltage, u2, v2, obere spannung, spannung max, maximalspannung, "
    "tension max, tension maximale, tensione massima, tensione max, voltaje máximo, "
    "tensão máxima, maximale spanning, napięcie maksymalne, maximální napětí, maksimum gerilim, "
    "största spänning, 最大电压, 最大電圧", "kV")
#: Headings of the stroke between two voltages, the most certain words first.
RANGES = (
    Meaning.of("range, peak to peak displacement, displacement peak to peak, peak to peak stroke, "
               "pk pk displacement, displacement pk pk, displacement pp, p p displacement, "
               "spitze spitze, doppelhub, hub p p, hub pp, crête à crête", "mm"),
    Meaning.of("stroke, actuation stroke, free stroke, actuation, hub, stellweg, course, corsa, "
               "carrera, curso, slag, skok, zdvih, strok, slaglängd, 行程, ストローク", "mm"))
#: Headings of a natural frequency.
FREQUENCIES = Meaning.of(
    "frequency, natural frequency, resonance, resonance frequency, resonant frequency, f, f0, "
    "frequenz, resonanz, eigenfrequenz, resonanzfrequenz, "
    "fréquence, fréquence propre, fréquence de résonance, "
    "frequenza, frequenza propria, frequenza naturale, frequenza di risonanza, "
    "frecuencia, frecuencia natural, frecuencia propia, frecuencia de resonancia, "
    "frequência, frequência natural, frequência de ressonância, "
    "frequentie, eigenfrequentie, resonantiefrequentie, "
    "częstotliwość, częstotliwość własna, częstotliwość rezonansowa, "
    "frekvence, vlastní frekvence, rezonanční frekvence, "
    "frekans, doğal frekans, rezonans frekansı, frekvens, egenfrekvens, resonansfrekvens, "
    "频率, 頻率, 共振频率, 谐振频率, 固有频率, 周波数, 共振周波数, 固有振動数", "Hz")
#: Headings of the quality of a resonance.
QUALITIES = Meaning.of(
    "quality, quality factor, q, q factor, güte, gütefaktor, schwinggüte, facteur de qualité, "
    "fattore di qualità, fattore di merito, factor de calidad, fator de qualidade, "
    "kwaliteitsfactor, dobroć, činitel jakosti, kalite faktörü, godhetstal, 品质因数, Q値")
#: Headings of a capacitance.
CAPACITANCES = Meaning.of(
    "capacitance, c, cp, cs, kapazität, capacité, capacità, capacitancia, capacidad, capacitância, "
    "capaciteit, pojemność, kapacita, kapasitans, sığa, kapacitans, 电容, 電容, 静電容量", "pF")
#: Headings of a run.
RUNS = ("run, run no, cycle, trial, lauf, messreihe, versuch, versuch nr, zyklus, durchlauf, "
        "essai, série, prova, ciclo, prueba, ensayo, ensaio, proef, cyclus, meting, "
        "próba, cykl, seria, pokus, cyklus, měření, deneme, döngü, försök, cykel, "
        "循环, 試験, サイクル")
#: Headings of a specimen or a test piece.
SPECIMENS = (
    "specimen, sample, actuator, film, membrane, device, specimen id, specimen no, specimen name, "
    "sample id, sample no, sample name, film id, film no, film name, "
    "probe, probe nr, probenname, probennummer, proben nr, prüfkörper, prüfling, aktor, aktuator, "
    "folie, membran, muster, "
    "éprouvette, échantillon, actionneur, "
    "provino, campione, membrana, attuatore, muestra, probeta, película, actuador, "
    "amostra, corpo de prova, provete, atuador, monster, proefstuk, membraan, "
    "próbka, folia, vzorek, fólie, aktuátor, numune, örnek, prov, provkropp, provbit, "
    "试样, 試樣, 样品, 薄膜, 試料, 試験片, サンプル, フィルム, shiryo")
#: Headings of a temperature.
TEMPERATURES = Meaning.of(
    "temperature, temperatur, prüftemperatur, température, temperatura, temperatuur, teplota, "
    "sıcaklık, 温度, 溫度", CELSIUS)
#: Headings of a stretch, or of a strain or displacement in its place.
STRETCHES = (
    Meaning.of("stretch, stretch ratio, lambda, λ, streckung, verstreckung, streckgrad, "
               "taux allongement, extension ratio, rapport allongement, rapporto di allungamento, "
               "伸长比, 拉伸比, 伸長比"),
    Meaning.of("strain, dehnung, tensile strain, tensile extension, zugdehnung, "
               "standarddehnung, déformation, deformation traction, allongement, "
               "deformazione, allungamento, deformación, alargamiento, deformação, alongamento, "
               "rek, odkształcenie, deformace, poměrná deformace, přetvoření, gerinim, uzama, "
               "töjning, 应变, 應變, ひずみ, 歪み", offset=1.0),
    Meaning(DISPLACEMENTS.words, "mm", "length", 1.0))
#: Headings of a nominal stress, or of a force in its place; true stresses are excluded.
STRESSES = (
    Meaning.of("stress, spannung, tensile stress, zugspannung, standardspannung, pk1, contrainte, "
               "contrainte traction, contrainte conventionnelle, tension, "
               "sforzo, tensione, esfuerzo, tensión, tensão, spanning, naprężenie, napětí, "
               "gerilme, gerilim, spänning, 应力, 應力, 応力", "kPa"),
    Meaning(FORCES.words, "N", "area"))

#: Headings of sizes of a test piece. A column of these has no readings.
SIZES = {
    "thickness": Meaning.of(
        "thickness, specimen thickness, dicke, probendicke, epaisseur, spessore, espesor, "
        "espessura, dikte, grubość, tloušťka, kalınlık, tjocklek, 厚度, 厚さ"),
    "width": Meaning.of(
        "width, specimen width, breite, probenbreite, largeur, larghezza, ancho, anchura, largura, "
        "breedte, szerokość, šířka, genişlik, bredd, 宽度, 寬度, 幅"),
    "length": Meaning.of(
        "gauge length, length, specimen length, grip separation, clamp distance, messlange, "
        "einspannlange, anfangsmesslange, longueur, longueur initiale, lunghezza, "
        "lunghezza iniziale, longitud, longitud inicial, comprimento, comprimento inicial, lengte, "
        "długość, délka, uzunluk, längd, 长度, 長度, 長さ, 標点距離")}
#: Words of columns that have a reading's unit but are no readings: sizes, and scatter of readings.
NO_READINGS = Meaning(frozenset().union(*(size.words for size in SIZES.values()), Meaning.of(
    "diameter, durchmesser, diamètre, diametro, diámetro, średnica, çap, 直径, 直徑, "
    "radius, rayon, raggio, radio, raio, straal, promień, poloměr, yarıçap, 半径, "
    "std, sd, std dev, standard deviation, deviation, sigma, error, uncertainty, scatter, "
    "standardabweichung, abweichung, streuung, fehler, unsicherheit, stabw, "
    "écart type, incertitude, erreur, deviazione, errore, incertezza, desviación, "
    "incertidumbre, desvio, incerteza, afwijking, fout, odchylenie, błąd, odchylka, chyba, "
    "hata, avvikelse, fel, 偏差, 标准差, 標準偏差, 误差, 誤差").words))
#: Words that turn a reading into another one: amplitudes, zeros, limits, true stresses.
OTHER_READINGS = Meaning.of(
    "peak, pk, pp, p p, amplitude, rms, eff, spitze, scheitel, crête, picco, pico, piek, "
    "breakdown, durchschlag, durchbruch, claquage, limit, max, min, maximum, minimum, "
    "zero, offset, null, nullwert, nullpunkt, reference, referenz, zéro, cero, nul, "
    "tare, tara, net, netto, gross, brutto, raw, roh, brut, corrected, korrigiert, corrigé, "
    "true, cauchy, wahre, wahr, vraie, vera, vero, verdadera, verdadeira, rate, geschwindigkeit, "
    "angular, kreisfrequenz, omega, ω, pulsation, step, schritt, range, "
    "change, änderung, delta, Δ, difference, differenz, preload, vorkraft, vorlast, précharge")
#: Headings of heights and distances of a sensor, which fall as a plate sinks.
HEIGHTS = Meaning.of(
    "height, distance, gap, höhe, abstand, hauteur, altezza, distanza, altura, distancia, "
    "distância, hoogte, afstand, wysokość, odległość, výška, vzdálenost, yükseklik, mesafe, "
    "höjd, avstånd, 高度, 高さ, 距离, 距離")
#: Words of lines with means, deviations or sums of readings.
SUMMARIES = Meaning.of(
    "mean, mean value, average, avg, median, std, std dev, stdev, standard deviation, sd, sum, "
    "total, max, min, maximum, minimum, count, "
    "mittel, mittelwert, mw, durchschnitt, standardabweichung, stabw, summe, anzahl, "
    "moyenne, moy, écart type, somme, media, valor medio, deviazione standard, dev std, somma, "
    "promedio, desviación estándar, média, desvio padrão, gemiddelde, standaardafwijking, "
    "średnia, odchylenie standardowe, průměr, směrodatná odchylka, ortalama, standart sapma, "
    "medelvärde, medel, standardavvikelse, 平均, 平均值, 平均値, 标准差, 標準偏差").words
#: Headings of columns that mark valid readings.
VALIDITIES = Meaning.of(
    "valid, ok, good, usable, use, include, exclude, excluded, discard, discarded, outlier, bad, "
    "gültig, verwendbar, ungültig, ausreißer, verworfen, valable, valide, rejeté, exclu, "
    "valido, scartato, válido, descartado, geldig, ongeldig, ważny, platný, geçerli, giltig, "
    "有效, 有効").words


def sums_up(cell: str) -> bool:
    """Check whether a cell labels a line as a mean, a deviation or a sum of others."""
    return plain_words(cell) in SUMMARIES
